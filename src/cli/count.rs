//! Whole numbers on the command line.

use std::fmt::Display;
use std::str::FromStr;

/// Parses whole numbers from `least` on. Anything else is refused with that bound; clap alone calls what is wrong with
/// a negative number an invalid digit.
pub(super) fn at_least<T>(
    least: T,
) -> impl Fn(&str) -> Result<T, String> + Clone + Send + Sync + 'static
where
    T: FromStr + PartialOrd + Display + Copy + Send + Sync + 'static,
{
    move |text: &str| match text.parse::<T>() {
        Ok(count) if count >= least => Ok(count),
        _ => Err(format!("must be a whole number of at least {least}")),
    }
}
