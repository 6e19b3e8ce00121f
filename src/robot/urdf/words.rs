//! Lists for use in sentences and notices.

use std::fmt::Display;

/// A longer list is cut after this many items.
pub(super) const FEW: usize = 8;

/// The items separated by commas; of a long list only the first ones and the number of the others.
pub(in crate::robot) fn listed<T: Display>(items: impl IntoIterator<Item = T>) -> String {
    let mut words: Vec<String> = items.into_iter().map(|item| item.to_string()).collect();
    let more = words.len().saturating_sub(FEW);
    words.truncate(FEW);
    let words = words.join(", ");
    if more == 0 { words } else { format!("{words} and {more} more") }
}

/// The notice about `items`, if there are any.
pub(in crate::robot) fn unless_empty<T, N>(
    items: Vec<T>,
    notice: impl FnOnce(Vec<T>) -> N,
) -> Option<N> {
    (!items.is_empty()).then(|| notice(items))
}

#[cfg(test)]
mod tests {
    use super::listed;

    #[test]
    fn of_many_the_first_ones_are_named() {
        assert_eq!(listed(["a", "b"]), "a, b");
        assert_eq!(listed(1..=8), "1, 2, 3, 4, 5, 6, 7, 8");
        assert_eq!(listed(1..=20), "1, 2, 3, 4, 5, 6, 7, 8 and 12 more");
    }
}
