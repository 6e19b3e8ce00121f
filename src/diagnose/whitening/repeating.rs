//! Torques of unknown height as noise.

use nalgebra::{DMatrix, DVector};

use crate::diagnose::image::{Image, Span, dot};

/// Torques of unknown height that repeat in every period, as noise of the mean period: with A the rows of torques whose height
/// has the standard deviation one, its covariance I + A Aᵀ is whitened by I + Q (√(I + R Rᵀ)⁻¹ − I) Qᵀ, A = Q R.
pub struct RepeatingNoise {
    /// Q.
    directions: Span,
    /// √(I + R Rᵀ)⁻¹ − I.
    change: DMatrix<f64>,
}

impl RepeatingNoise {
    /// Of torques whose whitened rows, at the height of one standard deviation, are `columns`.
    pub fn new(columns: &[Image]) -> Self {
        let mut directions = Span::default();
        columns.iter().for_each(|column| {
            directions.push(column);
        });
        let k = directions.len();
        if k == 0 {
            return Self { directions, change: DMatrix::zeros(0, 0) };
        }
        let coordinates =
            columns.iter().map(|column| DVector::from(directions.coordinates(column)));
        let mut covariance = DMatrix::identity(k, k);
        coordinates.for_each(|c| covariance += &c * c.transpose());
        let parts = covariance.symmetric_eigen();
        let shrunk =
            DMatrix::from_diagonal(&parts.eigenvalues.map(|square| square.powf(-0.5) - 1.0));
        let change = &parts.eigenvectors * shrunk * parts.eigenvectors.transpose();
        Self { directions, change }
    }

    /// Whitens `rows` of a mean period; symmetric, it is its own adjoint.
    pub fn whiten(&self, rows: &mut [f64]) {
        let along = self.directions.directions().map(|direction| dot(direction.mean, rows));
        let change = &self.change * DVector::from_iterator(self.directions.len(), along);
        for (direction, change) in self.directions.directions().zip(change.iter()) {
            rows.iter_mut().zip(direction.mean).for_each(|(row, d)| *row += change * d);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// W (I + A Aᵀ) W = I, for torques that resemble each other.
    #[test]
    fn noise_that_repeats_is_whitened() {
        let columns = [[3.0, 1.0, 0.0, 0.5], [2.5, 1.5, 0.0, 0.0]];
        let image = |rows: &[f64; 4]| Image { mean: rows.to_vec(), contrast: Vec::new() };
        let noise = RepeatingNoise::new(&columns.each_ref().map(image));
        let a = DMatrix::from_fn(4, 2, |row, k| columns[k][row]);
        let whitener = DMatrix::from_fn(4, 4, |row, k| {
            let mut unit = [0.0; 4];
            unit[k] = 1.0;
            noise.whiten(&mut unit);
            unit[row]
        });
        let covariance = DMatrix::identity(4, 4) + &a * a.transpose();
        let whitened = &whitener * covariance * whitener.transpose();
        assert!((whitened - DMatrix::identity(4, 4)).norm() < 1e-13);
        assert!((&whitener - whitener.transpose()).norm() < 1e-14);
    }
}
