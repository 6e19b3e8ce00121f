//! Signals in the whitened equations, and the subspace that known columns span there.

use std::ops::Range;

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par};
use nalgebra::DMatrix;

use crate::dynamics::with_widest_registers;

/// A torque signal on some joints, in Nm (or Nm per unit of its coefficient).
///
/// Each part is a joint and either n samples, which repeat in every period, or P·n samples.
#[derive(Debug, Clone, Default)]
pub struct Column {
    /// Joint (0-based) and samples.
    pub parts: Vec<(usize, Vec<f64>)>,
}

impl Column {
    /// A column on one joint.
    pub fn on(joint: usize, samples: Vec<f64>) -> Self {
        Self { parts: vec![(joint, samples)] }
    }

    /// A column on all joints of `signals`.
    pub fn everywhere(signals: &crate::robot::JointSignals) -> Self {
        Self { parts: (0..signals.joints()).map(|j| (j, signals.joint(j).to_vec())).collect() }
    }

    /// This column minus `other`, which is on the same joints.
    pub fn minus(mut self, other: &Self) -> Self {
        for ((_, own), (_, other)) in self.parts.iter_mut().zip(&other.parts) {
            own.iter_mut().zip(other).for_each(|(own, other)| *own -= other);
        }
        self
    }

    /// Every sample times `factor`.
    pub fn scaled(mut self, factor: f64) -> Self {
        self.parts.iter_mut().flat_map(|(_, y)| y).for_each(|v| *v *= factor);
        self
    }
}

/// A column in the whitened equations, where the noise of every row has variance one.
///
/// `mean` belongs to the mean of the periods, `contrast` to the differences between them. For a signal that repeats in
/// every period `contrast` is empty.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Image {
    /// Rows of the mean period.
    pub mean: Vec<f64>,
    /// Rows of the differences between periods; empty for a signal that repeats.
    pub contrast: Vec<f64>,
}

impl Image {
    /// Number of bytes of its rows.
    pub fn bytes(&self) -> usize {
        (self.mean.len() + self.contrast.len()) * size_of::<f64>()
    }

    /// ⟨self, other⟩.
    pub fn dot(&self, other: &Self) -> f64 {
        dot(&self.mean, &other.mean) + dot_of_contrasts(&self.contrast, &other.contrast)
    }

    /// Range from the first to the last non-zero row of the mean.
    fn support(&self) -> Range<usize> {
        let start = self.mean.iter().position(|v| *v != 0.0).unwrap_or(0);
        let end = self.mean.iter().rposition(|v| *v != 0.0).map_or(start, |last| last + 1);
        start..end
    }

    /// ⟨self, self⟩.
    pub fn square(&self) -> f64 {
        self.dot(self)
    }

    /// self += factor · other.
    pub fn add(&mut self, factor: f64, other: &Self) {
        axpy(&mut self.mean, factor, &other.mean);
        self.add_contrast(factor, &other.contrast);
    }

    fn add_contrast(&mut self, factor: f64, contrast: &[f64]) {
        if !contrast.is_empty() {
            self.contrast.resize(contrast.len(), 0.0);
            axpy(&mut self.contrast, factor, contrast);
        }
    }

    /// self *= factor.
    pub fn scale(&mut self, factor: f64) {
        self.mean.iter_mut().chain(&mut self.contrast).for_each(|v| *v *= factor);
    }
}

/// ⟨a, b⟩ of the differences between periods; zero if one of the signals repeats.
fn dot_of_contrasts(a: &[f64], b: &[f64]) -> f64 {
    if a.is_empty() || b.is_empty() { 0.0 } else { dot(a, b) }
}

/// ⟨a, b⟩ of long series.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    with_widest_registers(
        #[inline(always)]
        || crate::dot::dot(a, b),
    )
}

fn axpy(y: &mut [f64], factor: f64, x: &[f64]) {
    with_widest_registers(
        #[inline(always)]
        || y.iter_mut().zip(x).for_each(|(y, x)| *y += factor * x),
    );
}

/// Orthonormal basis of the span of columns, with the triangular matrix R of their QR decomposition.
#[derive(Debug, Clone, Default)]
pub struct Span {
    /// Means of the directions, one after another.
    means: Vec<f64>,
    /// Contrasts of the directions.
    contrasts: Vec<Vec<f64>>,
    /// Column k of R: coordinates of column k along the directions 0…k.
    triangle: Vec<Vec<f64>>,
}

/// A direction of a [`Span`], with the rows of an [`Image`].
#[derive(Debug, Clone, Copy)]
pub struct Direction<'a> {
    /// Rows of the mean period.
    pub mean: &'a [f64],
    /// Rows of the differences between periods; empty for a signal that repeats.
    pub contrast: &'a [f64],
}

/// A column that keeps less than this share of its length after orthogonalisation counts as linearly dependent on the
/// columns before it.
const DEPENDENT: f64 = 1e-6;

impl Span {
    /// Span of the parts of `images` outside `others`.
    pub fn outside(others: &Self, images: &[Image]) -> Self {
        let mut span = Self::default();
        for image in images {
            let mut image = image.clone();
            others.residualise(&mut image);
            span.take(image);
        }
        span
    }

    /// [`Self::outside`], and for each of its columns the index in `images` and whether the data determine its
    /// coefficient. They do not if other images add up to the column.
    pub fn telling(others: &Self, images: &[Image]) -> (Self, Vec<(usize, bool)>) {
        let outside = |image: &Image| {
            let mut image = image.clone();
            others.residualise(&mut image);
            image
        };
        let images: Vec<Image> = images.iter().map(outside).collect();
        let mut span = Self::default();
        let taken: Vec<usize> = (0..images.len()).filter(|&k| span.push(&images[k])).collect();
        let is_told = |k: usize| {
            let mut rest = Self::default();
            for (_, image) in images.iter().enumerate().filter(|(other, _)| *other != k) {
                rest.push(image);
            }
            rest.push(&images[k])
        };
        (span, taken.into_iter().map(|k| (k, is_told(k))).collect())
    }

    /// Dimensions.
    pub fn len(&self) -> usize {
        self.triangle.len()
    }

    /// Whether the span has no dimensions.
    pub fn is_empty(&self) -> bool {
        self.triangle.is_empty()
    }

    /// Adds `column` to the span. Returns `false`, and changes nothing, if it is spanned already.
    pub fn push(&mut self, column: &Image) -> bool {
        self.take(column.clone())
    }

    /// [`Self::push`], but only if the part of `column` outside the span is longer than `least`.
    pub fn push_longer_than(&mut self, least: f64, column: &Image) -> bool {
        let length = column.square().sqrt();
        self.take_longer_than(least.max(DEPENDENT * length), length, column.clone())
    }

    /// [`Self::push`] of a column that is not needed any more.
    fn take(&mut self, column: Image) -> bool {
        let length = column.square().sqrt();
        self.take_longer_than(DEPENDENT * length, length, column)
    }

    /// Adds a column of this `length` if its part outside the span is longer than `least`, by classical Gram-Schmidt,
    /// applied twice, which makes the directions as orthogonal as rounding allows (Giraud et al. 2005).
    fn take_longer_than(&mut self, least: f64, length: f64, mut rest: Image) -> bool {
        let mut coefficients = vec![0.0; self.len()];
        for _ in 0..2 {
            let along = self.project_out(std::slice::from_mut(&mut rest));
            coefficients.iter_mut().zip(along.col_as_slice(0)).for_each(|(c, a)| *c += a);
        }
        let outside = if self.is_empty() { length } else { rest.square().sqrt() };
        if outside.is_nan() || outside <= least {
            return false;
        }
        rest.scale(1.0 / outside);
        coefficients.push(outside);
        self.means.extend(rest.mean);
        self.contrasts.push(rest.contrast);
        self.triangle.push(coefficients);
        true
    }

    /// Removes from `column` its part inside the span.
    pub fn residualise(&self, column: &mut Image) {
        self.residualise_all(std::slice::from_mut(column));
    }

    /// Removes from all `columns` their parts inside the span, in one pass.
    pub fn residualise_all(&self, columns: &mut [Image]) {
        self.project_out(columns);
    }

    /// Removes from `columns` their parts inside the span, and returns the coordinates of these parts, one column for
    /// each.
    fn project_out(&self, columns: &mut [Image]) -> Mat<f64> {
        let along = self.along(columns);
        self.add_combinations(columns, -1.0, &along);
        along
    }

    /// columns += factor · directions · coordinates, all of them in one matrix product.
    pub(super) fn add_combinations(
        &self,
        columns: &mut [Image],
        factor: f64,
        coordinates: &Mat<f64>,
    ) {
        if self.is_empty() {
            return;
        }
        let mut sums = Mat::zeros(self.rows(), columns.len());
        matmul(&mut sums, Accum::Replace, self.means(), coordinates, factor, Par::Seq);
        for (c, column) in columns.iter_mut().enumerate() {
            axpy(&mut column.mean, 1.0, sums.col_as_slice(c));
            for (contrast, along) in self.contrasts.iter().zip(coordinates.col_as_slice(c)) {
                column.add_contrast(factor * along, contrast);
            }
        }
    }

    /// ⟨direction, column⟩, with one row per direction and one column per column. The means take one matrix product
    /// over the rows in which any of `columns` is not zero, or products of vectors if there is only one column. A
    /// column that acts on one joint of a single run is zero in the rows of all other joints.
    pub(super) fn along(&self, columns: &[Image]) -> Mat<f64> {
        let mut along = Mat::zeros(self.len(), columns.len());
        if self.is_empty() {
            return along;
        }
        let supports = columns.iter().map(Image::support).filter(|support| !support.is_empty());
        if let Some(support) = supports.reduce(|a, b| a.start.min(b.start)..a.end.max(b.end)) {
            if let [column] = columns {
                let of_directions = along.col_as_slice_mut(0).iter_mut().zip(self.directions());
                for (along, direction) in of_directions {
                    *along = dot(&direction.mean[support.clone()], &column.mean[support.clone()]);
                }
            } else {
                let mut means: Vec<f64> = Vec::with_capacity(support.len() * columns.len());
                columns.iter().for_each(|column| means.extend(&column.mean[support.clone()]));
                let means = MatRef::from_column_major_slice(&means, support.len(), columns.len());
                let directions = self.means().subrows(support.start, support.len()).transpose();
                matmul(&mut along, Accum::Replace, directions, means, 1.0, Par::Seq);
            }
        }
        for (c, column) in columns.iter().enumerate() {
            let along = along.col_as_slice_mut(c);
            for (along, contrast) in along.iter_mut().zip(&self.contrasts) {
                *along += dot_of_contrasts(contrast, &column.contrast);
            }
        }
        along
    }

    /// Means of the directions as a matrix, rows × dimensions.
    fn means(&self) -> MatRef<'_, f64> {
        MatRef::from_column_major_slice(&self.means, self.rows(), self.len())
    }

    /// Number of rows of a mean.
    fn rows(&self) -> usize {
        self.means.len() / self.len().max(1)
    }

    /// The part of `y` inside the span.
    pub fn inside(&self, y: &Image) -> Image {
        let mut part = y.clone();
        self.residualise(&mut part);
        part.scale(-1.0);
        part.add(1.0, y);
        part
    }

    /// Σ coordinate · direction.
    pub fn combination(&self, coordinates: &[f64]) -> Image {
        let mut sum = Image { mean: vec![0.0; self.rows()], contrast: Vec::new() };
        for (direction, coordinate) in self.directions().zip(coordinates) {
            axpy(&mut sum.mean, *coordinate, direction.mean);
            sum.add_contrast(*coordinate, direction.contrast);
        }
        sum
    }

    /// ⟨direction, y⟩ for every direction.
    pub fn coordinates(&self, y: &Image) -> Vec<f64> {
        self.along(std::slice::from_ref(y)).col_as_slice(0).to_vec()
    }

    /// Length² of the part of `y` inside the span.
    pub fn explained(&self, y: &Image) -> f64 {
        self.coordinates(y).iter().map(|along| along * along).sum()
    }

    /// Least-squares coefficients of `y` on the columns that were pushed.
    pub fn solve(&self, y: &Image) -> Vec<f64> {
        self.coefficients(self.coordinates(y))
    }

    /// [`Self::solve`] for a signal with these [coordinates](Self::coordinates).
    pub fn coefficients(&self, coordinates: Vec<f64>) -> Vec<f64> {
        let mut x = coordinates;
        for k in (0..x.len()).rev() {
            x[k] /= self.triangle[k][k];
            let value = x[k];
            for (x, r) in x[..k].iter_mut().zip(&self.triangle[k]) {
                *x -= r * value;
            }
        }
        x
    }

    /// Length of the first column.
    pub fn first_length(&self) -> f64 {
        self.triangle.first().map_or(0.0, |column| column[0])
    }

    /// The orthonormal directions.
    pub fn directions(&self) -> impl ExactSizeIterator<Item = Direction<'_>> {
        let rows = self.rows();
        self.contrasts.iter().enumerate().map(move |(k, contrast)| Direction {
            mean: &self.means[k * rows..(k + 1) * rows],
            contrast,
        })
    }

    /// R⁻¹, where columns = directions · R.
    pub fn inverse_triangle(&self) -> DMatrix<f64> {
        let k = self.len();
        let r = DMatrix::from_fn(k, k, |i, c| self.triangle[c].get(i).copied().unwrap_or(0.0));
        // Every pivot is positive: otherwise its column would not have been added.
        r.solve_upper_triangular(&DMatrix::identity(k, k)).unwrap_or_else(|| DMatrix::zeros(k, k))
    }

    /// (columnsᵀ columns)⁻¹ = R⁻¹R⁻ᵀ.
    pub fn inverse_gram(&self) -> DMatrix<f64> {
        let inverse = self.inverse_triangle();
        &inverse * inverse.transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(values: &[f64]) -> Image {
        Image { mean: values.to_vec(), contrast: Vec::new() }
    }

    #[test]
    fn solves_least_squares_and_knows_its_covariance() {
        let columns = [image(&[1.0, 1.0, 1.0, 1.0]), image(&[0.0, 1.0, 2.0, 3.0])];
        let mut span = Span::default();
        assert!(columns.iter().all(|c| span.push(c)));
        // The straight line through (k, 1 + 2k) and its Gram inverse by hand: [[14, −6], [−6, 4]]/20.
        let solution = span.solve(&image(&[1.0, 3.0, 5.0, 7.0]));
        assert!((solution[0] - 1.0).abs() < 1e-14 && (solution[1] - 2.0).abs() < 1e-14);
        let inverse = span.inverse_gram();
        for (entry, expected) in inverse.iter().zip([0.7, -0.3, -0.3, 0.2]) {
            assert!((entry - expected).abs() < 1e-14);
        }
        assert!(!span.push(&image(&[1.0, 2.0, 3.0, 4.0])), "a combination of both");
    }

    /// A zero column, an independent column, and two that are parallel.
    #[test]
    fn a_coefficient_is_told_where_no_other_column_stands_in_for_its_own() {
        let alike = [[0.0, 1.0, 1.0, 0.0], [0.0, -2.0, -2.0, 0.0]];
        let columns = [[0.0; 4], [1.0, 2.0, 0.0, 1.0], alike[0], alike[1]].map(|c| image(&c));
        let (span, told) = Span::telling(&Span::default(), &columns);
        assert_eq!(told, [(1, true), (2, false)]);
        let b = span.solve(&columns[1]);
        assert!((b[0] - 1.0).abs() < 1e-14 && b[1].abs() < 1e-14, "{b:?}");
    }

    #[test]
    fn what_repeats_is_orthogonal_to_what_does_not() {
        let repeating = image(&[1.0, 2.0]);
        let drifting = Image { mean: vec![0.0, 0.0], contrast: vec![3.0, 4.0] };
        assert_eq!(repeating.dot(&drifting), 0.0);
        assert_eq!(drifting.square(), 25.0);
    }
}
