//! The inertia of bodies.

use std::f64::consts::PI;

use approx::assert_abs_diff_eq;
use nalgebra::{Matrix3, Vector3};

use super::{BODY, model, one, read, says};
use crate::robot::mjcf::MjcfArm;

/// Mass, centre of mass, and the inertia tensor about it of a geom.
fn solid(geom: &str) -> (f64, Vector3<f64>, Matrix3<f64>) {
    let link = read(&one("", "", &format!("<joint/><geom {geom}/>"))).arm.joints[0].link;
    (link.mass_kg(), link.com_m().unwrap(), link.inertia_com_kg_m2().unwrap())
}

#[test]
fn solids_have_the_moments_of_the_textbook() {
    let diagonal = |x, y, z| Matrix3::from_diagonal(&Vector3::new(x, y, z));
    let close = |geom: &str, mass: f64, moments: Matrix3<f64>| {
        let (mass_kg, _, central) = solid(geom);
        assert_abs_diff_eq!(mass_kg, mass, epsilon = 1e-12 * mass);
        assert!((central - moments).amax() < 1e-12 * moments.amax(), "{geom}: {central}");
    };
    let ball = 4.0 / 3.0 * PI * 0.001 * 500.0;
    close(r#"size="0.1" density="500""#, ball, diagonal(1.0, 1.0, 1.0) * (0.4 * ball * 0.01));
    close(r#"type="ellipsoid" size="0.1 0.2 0.3" mass="2""#, 2.0, diagonal(0.13, 0.10, 0.05) * 0.4);
    close(r#"type="box" size="0.1 0.2 0.3" mass="3""#, 3.0, diagonal(0.13, 0.10, 0.05));
    let rod = PI * 0.01 * 0.6 * 1000.0;
    let across = rod * (3.0 * 0.01 + 0.36) / 12.0;
    close(r#"type="cylinder" size="0.1 0.3""#, rod, diagonal(across, across, rod * 0.01 / 2.0));
    says(&one("", "", r#"<joint/><geom type="box" size="0.1 0.2"/>"#), &["number 3 of size is 0"]);
    says(&one("", "", r#"<joint/><geom type="cone" size="1"/>"#), &["type=\"cone\"", "capsule"]);
}

/// Compares with a sum over slices of hemisphere, cylinder and hemisphere. The midpoint rule with 20 000 slices is
/// accurate to 1e-7.
#[test]
fn a_capsule_between_two_points_has_the_moments_of_its_slices() {
    let (from, to) = (Vector3::new(0.1, 0.0, 0.2), Vector3::new(0.1, 0.3, 0.6));
    let (mass_kg, com, central) =
        solid(r#"type="capsule" size="0.08" fromto="0.1 0 0.2 0.1 0.3 0.6""#);
    let (radius, half) = (0.08_f64, 0.25);
    let slices = 20_000;
    let step = 2.0 * (half + radius) / f64::from(slices);
    let (mut mass, mut across, mut along) = (0.0, 0.0, 0.0);
    for k in 0..slices {
        let z = -half - radius + (f64::from(k) + 0.5) * step;
        let beyond = (z.abs() - half).max(0.0);
        let squared = radius * radius - beyond * beyond;
        let slice = 1000.0 * PI * squared * step;
        mass += slice;
        across += slice * (squared / 4.0 + z * z);
        along += slice * squared / 2.0;
    }
    let axis = (to - from).normalize();
    let expected = Matrix3::identity() * across + axis * axis.transpose() * (along - across);
    assert!((mass_kg / mass - 1.0).abs() < 1e-6, "{mass_kg} {mass}");
    assert_abs_diff_eq!(com, (from + to) / 2.0, epsilon = 1e-14);
    assert!((central - expected).amax() < 1e-6 * across, "{central} {expected}");
}

#[test]
fn inertia_is_that_of_geoms_where_the_compiler_says_so() {
    let of = |compiler: &str, inside: &str| {
        let sections = format!("<compiler {compiler}/>");
        read(&one(&sections, "", &format!("<joint/>{inside}"))).arm.joints[0].link.mass_kg()
    };
    let geom = r#"<geom size="0.1" mass="3"/>"#;
    assert_eq!(of("", geom), 3.0);
    assert_eq!(of("", &format!("{geom}{BODY}")), 2.0);
    assert_eq!(of(r#"inertiafromgeom="true""#, &format!("{geom}{BODY}")), 3.0);
    assert_eq!(of(r#"inertiafromgeom="true""#, BODY), 2.0);
    let skin = r#"<geom size="0.2" mass="9" group="2"/><geom type="mesh" mesh="m" mass="0"/>"#;
    assert_eq!(of(r#"inertiagrouprange="0 1""#, &format!("{geom}{skin}")), 3.0);
    assert_eq!(of(r#"boundmass="5""#, BODY), 5.0);
    let never = one(r#"<compiler inertiafromgeom="false"/>"#, "", &format!("<joint/>{geom}"));
    says(&never, &["body \"a\"", "a_joint", "has no mass"]);
}

#[test]
fn bounds_of_moments_are_kept() {
    let text = one(
        r#"<compiler boundinertia="0.02" balanceinertia="true"/>"#,
        "",
        r#"<joint/><inertial pos="0 0 0" mass="1" diaginertia="0.01 0.03 0.09"/>"#,
    );
    let central = read(&text).arm.joints[0].link.inertia_com_kg_m2().unwrap();
    let mean = (0.02 + 0.03 + 0.09) / 3.0;
    assert!((central - Matrix3::identity() * mean).amax() < 1e-14, "{central}");
}

/// A massless mesh does not matter, nor does a mesh on a body that stands still.
#[test]
fn only_a_mesh_that_moves_needs_an_inertial() {
    let mesh = r#"<geom type="mesh" mesh="m"/>"#;
    let standing = model(
        "",
        &format!(r#"<body name="base">{mesh}<body name="a">{BODY}<joint/>{mesh}</body></body>"#),
    );
    let MjcfArm { arm, .. } = read(&standing);
    assert_eq!(arm.joints[0].link.mass_kg(), 2.0);
    let moving = one("", "", &format!("<joint/>{mesh}"));
    says(&moving, &["body \"a\" has no <inertial>", "line 1", "mj_saveLastXML"]);
    let fitted = one("", "", r#"<joint/><geom type="box" mesh="m"/>"#);
    says(&fitted, &["body \"a\" has no <inertial>"]);
}
