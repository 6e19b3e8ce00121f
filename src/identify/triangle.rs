//! Least squares by QR, fed block by block; only the triangle R is kept.

use crate::dot::dot;
use crate::dynamics::with_widest_registers;

/// R and QᵀY of X = Q R, and the length of the part of Y outside the span of X, for any number of rows.
///
/// Rows are appended in blocks that stay in cache; the whole X never goes through memory. The transformation is
/// Householder's, applied to `[R; block]`: the normal equations are never formed, and accuracy depends on cond(X),
/// not on its square. It is written here rather than taken from a library because it exploits the triangle on top,
/// allocates nothing, uses no fused multiply-add, and so gives the same bits on every machine.
#[derive(Debug, Clone)]
pub struct Triangle {
    columns: usize,
    right_hand_sides: usize,
    /// Column-major `columns × (columns + right_hand_sides)`: R, then QᵀY.
    entries: Vec<f64>,
    /// Squared length of each right-hand side outside the span of X.
    outside: Vec<f64>,
}

impl Triangle {
    /// A triangle without any rows.
    pub fn new(columns: usize, right_hand_sides: usize) -> Self {
        Self {
            columns,
            right_hand_sides,
            entries: vec![0.0; columns * (columns + right_hand_sides)],
            outside: vec![0.0; right_hand_sides],
        }
    }

    /// Forgets all rows.
    pub fn clear(&mut self) {
        self.entries.fill(0.0);
        self.outside.fill(0.0);
    }

    /// Number of columns c of X.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Number of columns of Y.
    pub fn right_hand_sides(&self) -> usize {
        self.right_hand_sides
    }

    /// R at row `i`, column `k`.
    pub fn r(&self, i: usize, k: usize) -> f64 {
        if i <= k { self.entries[k * self.columns + i] } else { 0.0 }
    }

    /// Column of QᵀY for right-hand side `p`.
    pub fn rhs(&self, p: usize) -> &[f64] {
        let start = (self.columns + p) * self.columns;
        &self.entries[start..start + self.columns]
    }

    /// Squared length of right-hand side `p` outside the span of X: its least-squares residual.
    pub fn outside(&self, p: usize) -> f64 {
        self.outside[p]
    }

    /// Appends the rows of `block`: `columns + right_hand_sides` runs of `rows` values each, column
    /// after column. The block is used as scratch.
    pub fn append(&mut self, block: &mut [f64], rows: usize) {
        assert_eq!(block.len(), rows * (self.columns + self.right_hand_sides));
        if rows > 0 {
            with_widest_registers(
                #[inline(always)]
                || self.eliminate(block, rows),
            );
        }
    }

    #[inline(always)]
    fn eliminate(&mut self, block: &mut [f64], rows: usize) {
        let c = self.columns;
        for k in 0..c {
            let (done, later) = block.split_at_mut((k + 1) * rows);
            let v = &mut done[k * rows..];
            let alpha = self.entries[k * c + k];
            let below = dot(v, v);
            if below == 0.0 {
                continue;
            }
            let beta = -(alpha * alpha + below).sqrt().copysign(alpha);
            let tau = (beta - alpha) / beta;
            let scale = 1.0 / (alpha - beta);
            v.iter_mut().for_each(|x| *x *= scale);
            self.entries[k * c + k] = beta;
            for (l, column) in later.chunks_exact_mut(rows).enumerate() {
                let top = &mut self.entries[(k + 1 + l) * c + k];
                let step = tau * (*top + dot(v, column));
                *top -= step;
                for (x, v) in column.iter_mut().zip(v.iter()) {
                    *x -= step * v;
                }
            }
        }
        for (p, column) in block[c * rows..].chunks_exact(rows).enumerate() {
            self.outside[p] += dot(column, column);
        }
    }

    /// x of min ‖X x − y‖ for right-hand side `rhs` (length c, overwritten with x). Needs full rank.
    pub fn solve_in_place(&self, rhs: &mut [f64]) {
        let c = self.columns;
        for k in (0..c).rev() {
            rhs[k] /= self.entries[k * c + k];
            let x = rhs[k];
            for (value, r) in rhs[..k].iter_mut().zip(&self.entries[k * c..]) {
                *value -= x * r;
            }
        }
    }

    /// R⁻¹, column-major c × c (upper triangular): (XᵀX)⁻¹ = R⁻¹ R⁻ᵀ.
    pub fn inverse(&self) -> Vec<f64> {
        let c = self.columns;
        let mut inverse = vec![0.0; c * c];
        for (k, column) in inverse.chunks_exact_mut(c.max(1)).enumerate() {
            column[k] = 1.0;
            self.solve_in_place(column);
        }
        inverse
    }

    /// Length of column `k` of X.
    pub fn column_length(&self, k: usize) -> f64 {
        let column = &self.entries[k * self.columns..k * self.columns + k + 1];
        dot(column, column).sqrt()
    }

    /// ‖X x − y_p‖² for any x, computed from the triangle alone, which stands for all rows.
    pub fn residual_squares(&self, x: &[f64], p: usize) -> f64 {
        let c = self.columns;
        let mut squares = self.outside[p];
        for (i, z) in self.rhs(p).iter().enumerate() {
            let predicted: f64 = (i..c).map(|k| self.entries[k * c + i] * x[k]).sum();
            squares += (predicted - z) * (predicted - z);
        }
        squares
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use faer::prelude::*;

    fn wobble(i: usize, k: usize) -> f64 {
        // A different frequency per column: nearly orthogonal columns.
        (i as f64 * (0.31 + 0.27 * k as f64) + k as f64).sin()
    }

    /// The least-squares solution of the same data by faer's QR, an implementation that shares nothing with this one.
    fn by_faer(rows: usize, columns: usize) -> (Mat<f64>, Mat<f64>, Mat<f64>) {
        let x = Mat::from_fn(rows, columns, wobble);
        let y = Mat::from_fn(rows, 2, |i, p| wobble(i, p + 50) * 3.0);
        let solution = x.qr().solve_lstsq(&y);
        (x, y, solution)
    }

    #[test]
    fn blocks_of_any_size_give_the_least_squares_solution_of_faer() {
        let (rows, columns) = (203, 9);
        let (x, y, reference) = by_faer(rows, columns);
        for block_rows in [1, 7, 64, 203] {
            let mut triangle = Triangle::new(columns, 2);
            let mut start = 0;
            while start < rows {
                let n = block_rows.min(rows - start);
                let mut block: Vec<f64> = (0..columns + 2)
                    .flat_map(|k| {
                        let (x, y) = (&x, &y);
                        (start..start + n)
                            .map(move |i| if k < columns { x[(i, k)] } else { y[(i, k - columns)] })
                    })
                    .collect();
                triangle.append(&mut block, n);
                start += n;
            }
            // Condition number of this X is below 10; rounding grows with rows·ε.
            let tolerance = 10.0 * rows as f64 * f64::EPSILON;
            for p in 0..2 {
                let mut solution = triangle.rhs(p).to_vec();
                triangle.solve_in_place(&mut solution);
                for k in 0..columns {
                    assert!((solution[k] - reference[(k, p)]).abs() < tolerance);
                }
                let direct: f64 = (0..rows)
                    .map(|i| {
                        let fit: f64 = (0..columns).map(|k| x[(i, k)] * solution[k]).sum();
                        (fit - y[(i, p)]).powi(2)
                    })
                    .sum();
                assert!((direct / triangle.residual_squares(&solution, p) - 1.0).abs() < tolerance);
            }
        }
    }

    #[test]
    fn the_inverse_times_the_triangle_is_one() {
        let mut triangle = Triangle::new(5, 0);
        let mut block: Vec<f64> = (0..5 * 40).map(|i| wobble(i % 40, i / 40)).collect();
        triangle.append(&mut block, 40);
        let inverse = triangle.inverse();
        for i in 0..5 {
            for k in 0..5 {
                let sum: f64 = (0..5).map(|l| triangle.r(i, l) * inverse[k * 5 + l]).sum();
                assert!((sum - f64::from(i == k)).abs() < 1e-13);
            }
        }
    }
}
