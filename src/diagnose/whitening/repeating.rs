//! Torques of unknown height, treated as noise.

use faer::Mat;
use nalgebra::{DMatrix, DVector};

use crate::diagnose::image::{Image, Span};

/// Torques of unknown height that repeat in every period, treated as noise of the mean period. With A the rows of
/// torques whose height has the standard deviation one, the covariance is I + A Aᵀ. It is whitened by I + Q (√(I + R
/// Rᵀ)⁻¹ − I) Qᵀ, where A = Q R.
pub struct RepeatingNoise {
    /// Q.
    directions: Span,
    /// √(I + R Rᵀ)⁻¹ − I.
    change: Mat<f64>,
}

impl RepeatingNoise {
    /// Noise of torques whose whitened rows, at a height of one standard deviation, are `columns`.
    pub fn new(columns: &[Image]) -> Self {
        let mut directions = Span::default();
        columns.iter().for_each(|column| {
            directions.push(column);
        });
        let k = directions.len();
        if k == 0 {
            return Self { directions, change: Mat::zeros(0, 0) };
        }
        let coordinates =
            columns.iter().map(|column| DVector::from(directions.coordinates(column)));
        let mut covariance = DMatrix::identity(k, k);
        coordinates.for_each(|c| covariance += &c * c.transpose());
        let parts = covariance.symmetric_eigen();
        let shrunk =
            DMatrix::from_diagonal(&parts.eigenvalues.map(|square| square.powf(-0.5) - 1.0));
        let change = &parts.eigenvectors * shrunk * parts.eigenvectors.transpose();
        Self { directions, change: Mat::from_fn(k, k, |i, j| change[(i, j)]) }
    }

    /// Whitens the means of `images`, all of them at once. The map is symmetric, hence its own adjoint.
    pub fn whiten(&self, images: &mut [Image]) {
        let change = &self.change * self.directions.along(images);
        self.directions.add_combinations(images, 1.0, &change);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// W (I + A Aᵀ) W = I, for similar torques.
    #[test]
    fn noise_that_repeats_is_whitened() {
        let columns = [[3.0, 1.0, 0.0, 0.5], [2.5, 1.5, 0.0, 0.0]];
        let image = |rows: &[f64; 4]| Image { mean: rows.to_vec(), contrast: Vec::new() };
        let noise = RepeatingNoise::new(&columns.each_ref().map(image));
        let a = DMatrix::from_fn(4, 2, |row, k| columns[k][row]);
        let whitener = DMatrix::from_fn(4, 4, |row, k| {
            let mut unit = image(&[0.0; 4]);
            unit.mean[k] = 1.0;
            noise.whiten(std::slice::from_mut(&mut unit));
            unit.mean[row]
        });
        let covariance = DMatrix::identity(4, 4) + &a * a.transpose();
        let whitened = &whitener * covariance * whitener.transpose();
        assert!((whitened - DMatrix::identity(4, 4)).norm() < 1e-13);
        assert!((&whitener - whitener.transpose()).norm() < 1e-14);
    }
}
