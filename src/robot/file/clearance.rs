//! Clearance keys that robot files and drive files share.

use serde::{Deserialize, Serialize};

use crate::robot::place::Place;
use crate::robot::{Capsule, CellBox, Clearance, RobotError};

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::robot) struct CapsuleEntry {
    name: String,
    body: usize,
    from_m: [f64; 3],
    to_m: [f64; 3],
    radius_m: f64,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::robot) struct BoxEntry {
    low_m: [f64; 3],
    high_m: [f64; 3],
}

/// The clearance keys of a file.
pub(in crate::robot) struct ClearanceKeys<'a> {
    /// `floor_z_m`.
    pub floor_z_m: Option<f64>,
    /// `[[capsule]]`.
    pub capsules: &'a [CapsuleEntry],
    /// `collision_pairs`.
    pub pairs: &'a [[String; 2]],
    /// `[[box]]`.
    pub boxes: &'a [BoxEntry],
    /// Number of bodies that the file may have behind the last one of the arm: where the arm ends with a link of a longer
    /// chain, the file is about the whole chain.
    pub bodies_behind: usize,
}

impl ClearanceKeys<'_> {
    /// Adds these keys, checked, to the `clearance` of an arm with `bodies` moving bodies. A capsule replaces one of
    /// the same name. Capsules of bodies behind these, and pairs with them, are left out.
    pub(in crate::robot) fn added_to(
        &self,
        mut clearance: Clearance,
        bodies: usize,
        place: &Place,
    ) -> Result<Clearance, RobotError> {
        place.finite("floor_z_m", self.floor_z_m.as_slice())?;
        place.unique("capsule", self.capsules.iter().map(|capsule| capsule.name.as_str()))?;
        clearance.floor_z_m = self.floor_z_m.or(clearance.floor_z_m);
        let is_behind =
            |entry: &CapsuleEntry| (bodies + 1..=bodies + self.bodies_behind).contains(&entry.body);
        for entry in self.capsules.iter().filter(|entry| !is_behind(entry)) {
            let capsule = entry.capsule(place, bodies)?;
            match clearance.capsules.iter().position(|known| known.name == capsule.name) {
                Some(at) => clearance.capsules[at] = capsule,
                None => clearance.capsules.push(capsule),
            }
        }
        // A shape of the model may have the name of a capsule that is left out: its pairs stay.
        let behind = self.capsules.iter().filter(|entry| is_behind(entry));
        let left_out: Vec<&str> = behind
            .map(|entry| entry.name.as_str())
            .filter(|name| clearance.capsules.iter().all(|capsule| capsule.name != *name))
            .collect();
        let is_left_out = |name: &String| left_out.contains(&name.as_str());
        for names in self.pairs.iter().filter(|names| !names.iter().any(is_left_out)) {
            let pair @ [one, other] = pair(&clearance, "collision_pairs", names, place)?;
            if !clearance.pairs.contains(&pair) && !clearance.pairs.contains(&[other, one]) {
                clearance.pairs.push(pair);
            }
        }
        for entry in self.boxes {
            let cell_box = entry.cell_box(place)?;
            if !clearance.boxes.contains(&cell_box) {
                clearance.boxes.push(cell_box);
            }
        }
        Ok(clearance)
    }
}

/// Positions in the list of the two capsules that `key` names.
pub(in crate::robot) fn pair(
    clearance: &Clearance,
    key: &str,
    [one, other]: &[String; 2],
    place: &Place,
) -> Result<[usize; 2], RobotError> {
    let find = |name: &str| {
        clearance.capsules.iter().position(|capsule| capsule.name == name).ok_or_else(|| {
            place.fault(format!("{key} names the capsule \"{name}\", which is not there"))
        })
    };
    if one == other {
        let what = format!("{key}: \"{one}\" cannot be kept clear of itself");
        return Err(place.fault(what));
    }
    Ok([find(one)?, find(other)?])
}

impl CapsuleEntry {
    pub(in crate::robot) fn of(capsule: &Capsule) -> Self {
        Self {
            name: capsule.name.clone(),
            body: capsule.body,
            from_m: capsule.from_m.into(),
            to_m: capsule.to_m.into(),
            radius_m: capsule.radius_m,
        }
    }

    fn capsule(&self, place: &Place, bodies: usize) -> Result<Capsule, RobotError> {
        place.plain_name("capsule", &self.name)?;
        let place = place.table("capsule", &self.name);
        if self.body > bodies {
            let body = self.body;
            let what = format!("body = {body} must be 0 (the base) or one of 1 … {bodies}");
            return Err(place.fault(what));
        }
        place.finite("from_m", &self.from_m)?;
        place.finite("to_m", &self.to_m)?;
        place.positive("radius_m", self.radius_m)?;
        Ok(Capsule {
            name: self.name.clone(),
            body: self.body,
            from_m: self.from_m.into(),
            to_m: self.to_m.into(),
            radius_m: self.radius_m,
        })
    }
}

impl BoxEntry {
    pub(in crate::robot) fn of(cell_box: &CellBox) -> Self {
        Self { low_m: cell_box.low_m.into(), high_m: cell_box.high_m.into() }
    }

    fn cell_box(&self, place: &Place) -> Result<CellBox, RobotError> {
        let Self { low_m, high_m } = self;
        place.finite("box: low_m", low_m)?;
        place.finite("box: high_m", high_m)?;
        if low_m.iter().zip(high_m).all(|(low, high)| low < high) {
            return Ok(CellBox { low_m: (*low_m).into(), high_m: (*high_m).into() });
        }
        Err(place.fault(format!(
            "box: low_m = {low_m:?} must be below high_m = {high_m:?} in every coordinate"
        )))
    }
}

#[cfg(test)]
mod tests {
    use crate::robot::Arm;

    const UR5: &str = include_str!("../../../robots/ur5.toml");

    fn message(from: &str, to: &str) -> String {
        assert!(UR5.contains(from), "{from}");
        Arm::from_toml(&UR5.replacen(from, to, 1), "x.toml").unwrap_err().to_string()
    }

    #[test]
    fn a_capsule_that_is_none_is_refused() {
        let body = message("name = \"wrist 3\"\nbody = 6", "name = \"wrist 3\"\nbody = 7");
        let stated = "x.toml: capsule \"wrist 3\": body = 7 must be 0 (the base) or one of 1 … 6";
        assert_eq!(body, stated);
        for value in ["nan", "inf", "0.0"] {
            let radius = message("radius_m = ", &format!("radius_m = {value} # "));
            assert!(radius.contains("radius_m = ") && radius.contains("positive"), "{radius}");
        }
        for key in ["from_m", "to_m"] {
            let end = message(&format!("{key} = ["), &format!("{key} = [0.0, inf, 0.0] # ["));
            assert!(end.contains("capsule \"base\"") && end.contains(key), "{end}");
        }
    }

    #[test]
    fn names_of_capsules_tell_them_apart() {
        let twice = message("name = \"wrist 3\"\nbody", "name = \"wrist 2\"\nbody");
        assert!(twice.contains("the capsule \"wrist 2\" is there twice"), "{twice}");
        let itself = message("[\"base\", \"forearm\"]", "[\"base\", \"base\"]");
        assert!(itself.contains("\"base\" cannot be kept clear of itself"), "{itself}");
        let unknown = message("[\"base\", \"forearm\"]", "[\"base\", \"tool\"]");
        assert!(unknown.contains("\"tool\", which is not there"), "{unknown}");
    }

    #[test]
    fn floor_and_boxes_are_somewhere() {
        let floor = message("floor_z_m = ", "floor_z_m = nan # ");
        assert!(floor.contains("floor_z_m: NaN is not a finite number"), "{floor}");
        let with = |low: &str| {
            let cell_box = format!("{UR5}\n[[box]]\nlow_m = {low}\nhigh_m = [1.0, 1.0, 1.0]\n");
            Arm::from_toml(&cell_box, "x.toml").map_err(|e| e.to_string())
        };
        assert_eq!(with("[0.0, 0.0, 0.0]").unwrap().clearance.boxes.len(), 1);
        assert!(with("[0.0, -inf, 0.0]").unwrap_err().contains("box: low_m: -inf"));
        assert!(with("[0.0, 2.0, 0.0]").unwrap_err().contains("in every coordinate"));
    }
}
