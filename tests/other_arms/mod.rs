//! Arms with other numbers of joints, from their URDF to a diagnosis. The truth is the URDF.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use armid::base::{BaseSet, Parameterisation};
use armid::diagnose::{Diagnosis, Kind, Verdict};
use armid::excitation::design::{
    Budget, Criterion, Design, Experiment, Specification, Variables, design,
};
use armid::excitation::{Requirements, check};
use armid::identify::covariance::squared_distance;
use armid::identify::{Estimator, Identification, Identifier};
use armid::montecarlo::{Scenario, Simulation};
use armid::robot::{LoadedArm, UrdfNotice};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use crate::misread_logs::assert_exchange_is_named;
use crate::simulated::{Run, assert_holds};

/// Encoder noise, in addition to that of the torque.
const ENCODERS: &str = "q_sd_rad = 2e-5\nqd_sd_rad_s = 1e-3\n";

/// An arm of this folder, and a motion designed for it by a small search.
pub struct Designed {
    robot: &'static str,
    noise_nm: &'static [f64],
    design: Design,
}

/// The folder of this file.
fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/other_arms")
}

fn load(robot: &str) -> LoadedArm {
    LoadedArm::load(folder().join(robot).with_extension("urdf").to_str().unwrap()).unwrap()
}

impl Designed {
    /// Designs a motion of three harmonics with period `period_s`, played eight times under torque noise of `noise_nm`.
    pub fn new(robot: &'static str, period_s: f64, noise_nm: &'static [f64]) -> Self {
        let arm = load(robot).arm;
        let full = Parameterisation::full(arm.dof(), arm.torque_offsets);
        let set = BaseSet::find(&arm, full).unwrap();
        let spec = Specification {
            criterion: Criterion::D,
            variables: Variables {
                order: 3,
                period_s,
                period_range_s: None,
                fixed_offsets_rad: vec![None; arm.dof()],
                rest_start: false,
            },
            requirements: Requirements::default(),
            experiment: Experiment {
                data_s: 8.0 * period_s,
                rate_hz: 125.0,
                torque_noise_nm: noise_nm.to_vec(),
            },
            prior: None,
            starts: 2,
            finalists: 1,
            seed: 1,
        };
        let stop = AtomicBool::new(false);
        let budget = Budget { deadline: None, stop: &stop };
        let design = design(&arm, &set, &spec, &budget, &|_| {}).unwrap();
        assert!(check(&arm, &spec.requirements, &design.excitation).unwrap().feasible());
        Self { robot, noise_nm, design }
    }

    /// The motion as a trajectory file.
    pub fn trajectory(&self) -> String {
        self.design.excitation.series().to_json()
    }

    /// Simulates this number of periods of the motion, in a scenario that ends with `rest`.
    pub fn run(&self, periods: usize, rest: &str) -> Run {
        let Self { robot, noise_nm, .. } = self;
        let temporary = tempfile::tempdir().unwrap();
        let trajectory = temporary.path().join("designed.json");
        std::fs::write(&trajectory, self.trajectory()).unwrap();
        let text = format!(
            "name = \"{robot}\"\nrobot = \"{robot}.urdf\"\nseed = 1\ntrials = 1\n[motion]\ntrajectory = '{}'\n\
             periods = {periods}\n[sensors]\ntorque_sd_nm = {noise_nm:?}\n{ENCODERS}{rest}",
            trajectory.display()
        );
        let scenario = Scenario::from_toml(&text, robot, &folder()).unwrap();
        Run::of(&Simulation::run(scenario).unwrap(), 0)
    }
}

fn identify(run: &Run) -> Identification {
    let mut identifier = Identifier::new(&run.model, &run.set, run.options.clone());
    identifier.identify(&run.log.measurement(&run.arm.name)).unwrap()
}

fn diagnose(run: &Run) -> Diagnosis {
    let m = run.log.measurement(&run.arm.name);
    let d = run.diagnoser().diagnose(&m, &[], None).unwrap().diagnosis;
    println!("{:#?}", d.sentences);
    d
}

/// Asserts that the log `run` determines all `rank` base parameters. From the scatter of eight periods, σ has some
/// forty degrees of freedom: the largest of 28 errors exceeds 5 σ once in 3500 logs, and all errors together exceed the
/// limit of F once in 10⁴. The mean of all σ is known to a few percent, and the prediction leaves out encoder noise: a
/// tolerance of a fifth covers both.
fn assert_truth(designed: &Designed, run: &Run, rank: usize) {
    let found = identify(run);
    assert_eq!(found.estimator, Estimator::Spectral);
    assert_eq!((run.set.rank(), found.fit.theta.len()), (rank, rank));
    let truth = run.set.values(&run.model.standard_parameters());
    let error: Vec<f64> = found.fit.theta.iter().zip(&truth).map(|(x, truth)| x - truth).collect();
    let sigma = found.sigma();
    for (k, (error, sigma)) in error.iter().zip(&sigma).enumerate() {
        println!("{}: {:.2} sigma", run.set.name(k), error / sigma);
        assert!(error.abs() < 5.0 * sigma, "{}: {error} {sigma}", run.set.name(k));
    }
    let squared = squared_distance(&found.covariance.matrix, &error).unwrap();
    let freedom = found.covariance.degrees_of_freedom;
    let law = FisherSnedecor::new(rank as f64, freedom).unwrap();
    assert!(law.sf(squared / rank as f64) > 1e-4, "{squared} of {rank}, {freedom}");
    assert!(found.lack_of_fit.unwrap().fits(), "{:?}", found.lack_of_fit);
    let logarithm = |sigma: &[f64]| sigma.iter().map(|s| s.ln()).sum::<f64>() / rank as f64;
    let prediction = &designed.design.prediction;
    let shorter = designed.design.excitation.periods() as f64 / found.processing.periods as f64;
    let ratio = (logarithm(&sigma) - logarithm(&prediction.sigma)).exp() / shorter.sqrt();
    assert!((0.8..1.2).contains(&ratio), "{ratio} times the predicted sigma");
}

/// Asserts that nothing is found in the log `clean`, and only `effect` in the log of an arm with it.
fn assert_diagnosed(
    designed: &Designed,
    clean: &Run,
    effect: &str,
    place: (Kind, Option<usize>),
    (parameter, truth): (&str, f64),
) {
    let d = diagnose(clean);
    assert_eq!(d.verdict, Verdict::NothingFound, "{:?}", d.causes);
    let d = diagnose(&designed.run(8, &format!("[[effect]]\n{effect}")));
    let named: Vec<_> = d.causes.iter().map(|c| (c.kind, c.joint)).collect();
    assert_eq!((named, d.verdict), (vec![place], Verdict::CauseNamed));
    assert_holds(&d.causes[0], parameter, truth);
}

/// The tool becomes a part of the last body; friction and limits are those in the file.
#[test]
fn a_urdf_of_three_joints_is_read_as_written() {
    let LoadedArm { arm, notices, .. } = load("three_joints");
    assert_eq!(arm.dof(), 3);
    let masses: Vec<f64> = arm.joints.iter().map(|joint| joint.link.mass_kg()).collect();
    assert!((masses[2] - 2.3).abs() < 1e-12, "{masses:?}");
    let merged = notices.iter().flat_map(|notice| match notice {
        UrdfNotice::Merged { links, .. } => links.as_slice(),
        _ => &[],
    });
    assert!(merged.map(|(link, _)| link.as_str()).eq(["tool"]));
    let friction = arm.joints.iter().map(|j| (j.drive.coulomb_nm, j.drive.viscous_nm_s_rad));
    assert!(friction.eq([(6.0, 5.0), (5.0, 4.0), (1.5, 1.0)]));
    let limits = arm.joints.iter().map(|j| (j.limits.torque_nm, j.limits.velocity_rad_s));
    assert!(limits.eq([(150.0, 2.5), (100.0, 2.5), (40.0, 3.0)]));
}

/// Torque determines, for the first body, the inertia about its fixed axis and two first moments; seven numbers for
/// each later body; the rotor inertias of the later joints; and friction and an offset of every joint: 3 + 2 · 7 + 2 +
/// 3 · 3.
#[test]
fn an_arm_of_three_joints_is_identified_and_diagnosed() {
    let designed = Designed::new("three_joints", 5.0, &[0.5, 0.4, 0.1]);
    let clean = designed.run(8, "");
    assert_truth(&designed, &clean, 28);
    assert_exchange_is_named(&clean, [1, 2]);
    let effect = "kind = \"load_friction\"\njoint = 2\nmu = 0.06\n";
    assert_diagnosed(&designed, &clean, effect, (Kind::LoadFriction, Some(2)), ("mu", 0.06));
}

/// For its body, torque determines the inertia and two first moments.
#[test]
fn a_single_joint_is_an_arm() {
    let designed = Designed::new("one_joint", 5.0, &[0.3]);
    let clean = designed.run(8, "");
    assert_truth(&designed, &clean, 6);
    let effect = "kind = \"stribeck\"\njoint = 1\nextra_nm = 0.8\nvs_rad_s = 0.1\n";
    assert_diagnosed(&designed, &clean, effect, (Kind::Stribeck, Some(1)), ("extra_nm", 0.8));
}
