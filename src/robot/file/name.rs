//! Names of robots: a built-in arm, a file, or a file with the last link of the arm.

use std::path::Path;

/// Splits `FILE.urdf#LINK` (or `FILE.xml#BODY`) into file and link. Any other name, and the name of a file that exists
/// under it, stays whole.
pub(super) fn split(name: &str) -> (&str, Option<&str>) {
    let is_file = |name: &str| Path::new(name).extension().is_some();
    match name.rsplit_once('#') {
        Some((file, link)) if is_file(file) && !Path::new(name).exists() => (file, Some(link)),
        _ => (name, None),
    }
}

#[cfg(test)]
mod tests {
    use super::split;

    #[test]
    fn what_stands_behind_the_last_number_sign_is_a_link() {
        assert_eq!(split("a.urdf#tool0"), ("a.urdf", Some("tool0")));
        assert_eq!(split("dir/a.URDF#left/tool0"), ("dir/a.URDF", Some("left/tool0")));
        assert_eq!(split("a#b.urdf#tool.0"), ("a#b.urdf", Some("tool.0")));
        assert_eq!(split("a.urdf#"), ("a.urdf", Some("")));
        for plain in ["ur5", "ur5#tool0", "a.urdf", "cell#2/a.urdf"] {
            assert_eq!(split(plain), (plain, None));
        }
    }

    #[test]
    fn a_file_that_has_the_name_is_that_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.urdf#b.urdf");
        let name = path.to_str().unwrap();
        assert_eq!(split(name).1, Some("b.urdf"));
        std::fs::write(&path, "").unwrap();
        assert_eq!(split(name), (name, None));
    }
}
