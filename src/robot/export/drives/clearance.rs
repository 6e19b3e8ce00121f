//! Clearance keys of a drive file, which add to the shapes of the links.

use serde::{Deserialize, Serialize};

use super::DriveFile;
use crate::robot::file::{ClearanceKeys, pair};
use crate::robot::place::Place;
use crate::robot::{Arm, Clearance, RobotError};

/// Sources of the arm's clearance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Source {
    /// The collision shapes of the links and the drive file.
    #[serde(rename = "shapes")]
    Shapes,
    /// The drive file alone.
    #[serde(rename = "none")]
    Nothing,
}

impl DriveFile {
    /// Adds what the file says about clearance to that of `arm`, which comes from the shapes of its links. The file may
    /// also be about the bodies of `locked` further joints, which count in those of the arm: what it says about them is
    /// left out.
    pub(super) fn add_clearance(
        &self,
        arm: &mut Arm,
        locked: usize,
        place: &Place,
    ) -> Result<(), RobotError> {
        let of_shapes = std::mem::take(&mut arm.clearance);
        let begin = if self.sets_shapes_aside() { Clearance::default() } else { of_shapes };
        let keys = ClearanceKeys {
            floor_z_m: self.floor_z_m,
            capsules: &self.capsules,
            pairs: &self.collision_pairs,
            boxes: &self.boxes,
            bodies_behind: locked,
        };
        let mut clearance = keys.added_to(begin, arm.dof(), place)?;
        for names in &self.unwatched_pairs {
            // The shapes of a locked link are part of the body that carries it, and need not keep its name.
            if locked > 0 && !are_there(&clearance, names) {
                continue;
            }
            let [one, other] = pair(&clearance, "unwatched_pairs", names, place)?;
            clearance.pairs.retain(|known| *known != [one, other] && *known != [other, one]);
        }
        arm.clearance = clearance;
        Ok(())
    }

    /// Pairs of the file that are not kept apart, as far as `clearance` has both capsules.
    pub(super) fn unwatched_in(&self, clearance: &Clearance) -> Vec<[String; 2]> {
        self.unwatched_pairs.iter().filter(|names| are_there(clearance, names)).cloned().collect()
    }

    /// Whether only the file's own keys count.
    pub(super) fn sets_shapes_aside(&self) -> bool {
        self.clearance == Some(Source::Nothing)
    }
}

/// Whether `clearance` has the two capsules of these names.
fn are_there(clearance: &Clearance, names: &[String; 2]) -> bool {
    names.iter().all(|name| clearance.capsules.iter().any(|capsule| capsule.name == *name))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::export::{drive_file_of_mjcf, drive_file_of_urdf};

    fn cleared(text: &str) -> Result<Clearance, String> {
        cleared_with(text, &[])
    }

    /// The clearance of the arm with the drive file `text`, where these joints of its model are locked.
    fn cleared_with(text: &str, locked: &[&str]) -> Result<Clearance, String> {
        let mut arm = Arm::built_in("ur5").unwrap();
        let file = DriveFile::read(text, "x.drives.toml").map_err(|e| e.to_string())?;
        file.apply(&mut arm, locked, "x.drives.toml").map_err(|e| e.to_string())?;
        Ok(arm.clearance)
    }

    const TOOL: &str = "[[capsule]]\nname = \"tool\"\nbody = 6\nfrom_m = [0.0, 0.0, 0.0]\n\
        to_m = [0.0, 0.0, 0.1]\nradius_m = 0.03\n";

    #[test]
    fn it_adds_to_the_shapes_or_sets_them_aside() {
        let of_shapes = Arm::built_in("ur5").unwrap().clearance;
        assert_eq!(cleared("").unwrap(), of_shapes);
        let lower = cleared("clearance = \"shapes\"\nfloor_z_m = -0.3").unwrap();
        assert_eq!(lower, Clearance { floor_z_m: Some(-0.3), ..of_shapes.clone() });
        assert_eq!(cleared("clearance = \"none\"").unwrap(), Clearance::default());
        let alone = cleared(&format!("clearance = \"none\"\nfloor_z_m = 0.1\n{TOOL}")).unwrap();
        assert_eq!((alone.capsules.len(), alone.pairs.len()), (1, 0));
        assert_eq!(alone.floor_z_m, Some(0.1));
        let with_tool = cleared(&format!(
            "collision_pairs = [[\"tool\", \"base\"]]\nunwatched_pairs = [[\"forearm\", \"base\"]]\n{TOOL}"
        ))
        .unwrap();
        assert_eq!(with_tool.capsules.len(), of_shapes.capsules.len() + 1);
        // One pair was added and one removed.
        assert_eq!(with_tool.pairs.len(), of_shapes.pairs.len());
        assert!(with_tool.pairs.contains(&[of_shapes.capsules.len(), 0]));
        let wider = cleared(&TOOL.replace("tool", "wrist 3")).unwrap();
        assert_eq!(wider.capsules.len(), of_shapes.capsules.len());
        assert!(wider.capsules.iter().any(|one| one.name == "wrist 3" && one.radius_m == 0.03));
    }

    /// Hand-written clearance stays in the drive file; that of the shapes is not repeated in it.
    #[test]
    fn it_is_kept_where_a_urdf_is_exported() {
        let arm = Arm::built_in("ur5").unwrap();
        let text = format!("clearance = \"none\"\nfloor_z_m = -0.3\n{TOOL}");
        let written = drive_file_of_urdf(&arm, &[0.0; 6], &text, "x.drives.toml").unwrap();
        assert_eq!(cleared(&written), cleared(&text));
        assert!(!drive_file_of_urdf(&arm, &[0.0; 6], "", "").unwrap().contains("capsule"));
    }

    /// One more joint is locked, so that the file may be about a seventh body, and not about an eighth.
    #[test]
    fn what_is_behind_the_last_link_is_left_out() {
        let behind = TOOL.replace("body = 6", "body = 7");
        let pairs = "collision_pairs = [[\"tool\", \"base\"]]\nunwatched_pairs = [[\"tool\", \"forearm\"]]\n";
        let text = format!("{pairs}{behind}");
        let of_shapes = Arm::built_in("ur5").unwrap().clearance;
        assert_eq!(cleared_with(&text, &["finger"]).unwrap(), of_shapes);
        let farther = cleared_with(&text.replace("body = 7", "body = 8"), &["finger"]).unwrap_err();
        assert!(farther.contains("body = 8 must be 0 (the base) or one of 1 … 6"), "{farther}");
        let unknown = cleared_with("collision_pairs = [[\"tool\", \"base\"]]", &["finger"]);
        assert!(unknown.unwrap_err().contains("\"tool\", which is not there"));
        // The drive file of an MJCF, which has no joints but the arm's, does not name them either.
        let arm = Arm::built_in("ur5").unwrap();
        let written = drive_file_of_mjcf(&arm, &[0.0; 6], &text, "x.drives.toml").unwrap();
        assert!(!written.contains("tool"), "{written}");
        assert_eq!(cleared(&written).unwrap(), of_shapes);
    }

    #[test]
    fn what_it_cannot_mean_is_refused() {
        let none = cleared("clearance = \"off\"").unwrap_err();
        assert!(none.contains("off") && none.contains("shapes"), "{none}");
        let unknown = cleared("unwatched_pairs = [[\"base\", \"tail\"]]").unwrap_err();
        assert!(unknown.contains("unwatched_pairs names the capsule \"tail\""), "{unknown}");
        let floor = cleared("floor_z_m = nan").unwrap_err();
        assert!(floor.contains("floor_z_m: NaN is not a finite number"), "{floor}");
        let body = cleared(&TOOL.replace("body = 6", "body = 7")).unwrap_err();
        assert!(body.contains("body = 7 must be 0 (the base) or one of 1 … 6"), "{body}");
    }
}
