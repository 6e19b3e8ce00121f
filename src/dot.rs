//! The sum of products, ⟨a, b⟩ = Σ aₖ bₖ.

/// Dot product ⟨a, b⟩ of two slices of equal length, in sixteen interleaved partial sums that the compiler can keep in
/// registers.
///
/// The order of summation is fixed, and with it every bit of the result.
#[inline(always)]
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    debug_assert_eq!(a.len(), b.len());
    const WAYS: usize = 16;
    let mut partial = [0.0; WAYS];
    let (a_whole, a_rest) = a.as_chunks::<WAYS>();
    let (b_whole, b_rest) = b.as_chunks::<WAYS>();
    for (x, y) in a_whole.iter().zip(b_whole) {
        for k in 0..WAYS {
            partial[k] += x[k] * y[k];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(x, y)| x * y).sum();
    partial.iter().sum::<f64>() + rest
}
