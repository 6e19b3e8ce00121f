//! Estimates the noise of a series that also contains motion, from differences of an order so high that the motion
//! cancels.

/// Coefficients of the sixth difference; their squares sum to 924.
const SIXTH: [f64; 7] = [1.0, -6.0, 15.0, -20.0, 15.0, -6.0, 1.0];
const SIXTH_POWER: f64 = 924.0;

/// Noise levels of all blocks of `block` samples, in ascending order: rms of Δ⁶y/√924.
///
/// White noise of rms σ gives σ. A motion y = A sin ωt contributes only A(ωh)⁶/√924, which at 1 Hz and 125 samples per
/// second is 5e-10 of its amplitude.
pub(super) fn block_noise(y: &[f64], block: usize) -> Vec<f64> {
    let mut levels: Vec<f64> = y
        .chunks_exact(block.max(SIXTH.len()))
        .map(|part| {
            let square: f64 = part.windows(SIXTH.len()).map(|w| sixth_difference(w).powi(2)).sum();
            (square / ((part.len() - SIXTH.len() + 1) as f64 * SIXTH_POWER)).sqrt()
        })
        .collect();
    levels.sort_by(f64::total_cmp);
    levels
}

fn sixth_difference(window: &[f64]) -> f64 {
    window.iter().zip(SIXTH).map(|(v, c)| v * c).sum()
}
