//! Notices about several joints at once.

use super::{joint, read, robot, two_joints};

/// The notices about the arm j1, j2 whose joints are both of this `kind` and contain the elements `inside`.
fn told(kind: &str, inside: &str) -> Vec<String> {
    let mut parts = two_joints();
    parts[3] = joint("j1", kind, "base", "a", inside);
    parts[4] = joint("j2", kind, "a", "b", inside);
    read(&robot(&parts)).notices.iter().map(ToString::to_string).collect()
}

#[test]
fn what_holds_for_several_joints_is_one_line() {
    let inside = r#"<origin xyz="0 0 0.1" rpy="1.5708 0 3.14159"/><axis xyz="0 0.6001 -0.8"/>"#;
    let lines = told("continuous", inside);
    for line in [
        "no end stops, taken as -2 pi to 2 pi: j1, j2",
        "frames of joints are turned from those of their links to have z along the axis, parameters are about them: \
         j1 (0, 0.6001, -0.8), j2 (0, 0.6001, -0.8)",
        "angles that are off multiples of pi/2 by 3.7e-6 rad or less are taken as these: joint \"j1\", joint \"j2\"",
    ] {
        assert!(lines.contains(&line.to_owned()), "{line}: {lines:?}");
    }
    // 1.5709 is 1e-4 from a right angle.
    let lines = told("continuous", r#"<origin xyz="0 0 0.1" rpy="1.5709 0 0"/>"#);
    let line = "angles near multiples of pi/2 are taken literally, so that axes are not quite parallel: \
        joint \"j1\" 1.5709 (of a right angle write 1.5707963), joint \"j2\" 1.5709 (of a right angle write 1.5707963)";
    assert!(lines.contains(&line.to_owned()), "{lines:?}");
    let lines = told("revolute", r#"<limit lower="-170" upper="170" effort="1" velocity="1"/>"#);
    let line = "ranges of more than two turns, are they in degrees? The file's unit is rad: j1 (-170 to 170 rad), j2 (-170 to 170 rad)";
    assert!(lines.contains(&line.to_owned()), "{lines:?}");
}

#[test]
fn axes_that_are_no_unit_vectors_are_one_line() {
    let lines = told("continuous", r#"<axis xyz="0 0.6001 -0.8"/>"#);
    let length =
        |line: &&String| line.starts_with("axes that are not of length 1 were made so: j1 (");
    assert_eq!(lines.iter().filter(length).count(), 1, "{lines:?}");
}
