//! Search for mesh files.

use std::path::{Path, PathBuf};

/// The mesh file that a robot file in `folder` calls `name`.
///
/// For `package://NAME/REST`, the package is a folder called NAME that is an ancestor of `folder` or a child of an
/// ancestor. Otherwise REST is searched for in the ancestors themselves, as for a copied part of a package.
pub(super) fn find(name: &str, folder: &Path) -> Option<PathBuf> {
    if let Some(rest) = name.strip_prefix("package://").or(name.strip_prefix("model://")) {
        return in_package(rest, folder);
    }
    let path = folder.join(name.strip_prefix("file://").unwrap_or(name));
    path.is_file().then_some(path)
}

fn in_package(rest: &str, folder: &Path) -> Option<PathBuf> {
    let (package, inside) = rest.split_once('/')?;
    let here = if folder == Path::new("") { Path::new(".") } else { folder };
    let whole = std::path::absolute(here).ok()?;
    let found = whole.ancestors().find_map(|above| {
        let is_package = above.file_name().and_then(|name| name.to_str()) == Some(package);
        let own = is_package.then(|| above.join(inside));
        let others = [above.join(package).join(inside), above.join(inside)];
        own.into_iter().chain(others).find(|path| path.is_file())
    })?;
    // A file below `folder` keeps the path of `folder` as it was written.
    let below = found.strip_prefix(&whole).map(|below| folder.join(below));
    Some(below.unwrap_or(found))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_package_is_above_or_beside() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str| {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(&path, "").unwrap();
            path
        };
        let urdf = folder.path().join("src/my_arm/urdf");
        let own = write("src/my_arm/meshes/link.stl");
        let beside = write("src/tools/meshes/hand.stl");
        let copied = write("src/my_arm/urdf/meshes/copied.stl");
        let found = |name: &str| find(name, &urdf);
        assert_eq!(found("package://my_arm/meshes/link.stl"), Some(own.clone()));
        assert_eq!(found("package://tools/meshes/hand.stl"), Some(beside));
        assert_eq!(found("package://elsewhere/meshes/copied.stl"), Some(copied.clone()));
        assert_eq!(found("model://my_arm/meshes/link.stl"), Some(own.clone()));
        assert_eq!(found("meshes/copied.stl"), Some(copied));
        assert_eq!(found("../meshes/link.stl"), Some(urdf.join("../meshes/link.stl")));
        assert_eq!(found(&format!("file://{}", own.display())), Some(own));
        for missing in ["package://my_arm/meshes/arm.stl", "package://my_arm", "", "meshes"] {
            assert_eq!(found(missing), None, "{missing}");
        }
    }
}
