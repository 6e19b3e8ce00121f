//! Public logs of real arms, which lie outside the repository.

use std::path::PathBuf;

/// The folder named by `ARMID_DATA`, which has the logs of a UR10e in `ur10e/`. If there is none, the reason is printed
/// and the tests pass.
pub fn folder() -> Option<PathBuf> {
    let Some(folder) = std::env::var_os("ARMID_DATA").map(PathBuf::from) else {
        println!("skipped: ARMID_DATA is not set (the folder with the real logs)");
        return None;
    };
    if !folder.join("ur10e").is_dir() {
        println!("skipped: ARMID_DATA = {} has no folder ur10e", folder.display());
        return None;
    }
    Some(folder)
}
