//! The size of an error.

/// Rms of the samples that count, Nm; NaN if none does, because that is not an error of size zero.
pub fn rms_where(e: &[f64], counts: impl Fn(usize) -> bool) -> f64 {
    let (mut square, mut count) = (0.0, 0usize);
    for (_, e) in e.iter().enumerate().filter(|(k, _)| counts(*k)) {
        square += e * e;
        count += 1;
    }
    (square / count as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_samples_have_no_size() {
        assert_eq!(rms_where(&[3.0, 100.0, -4.0], |k| k != 1), 12.5_f64.sqrt());
        assert!(rms_where(&[3.0, 4.0], |_| false).is_nan());
    }
}
