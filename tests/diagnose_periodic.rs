//! Effects produced by the physics of a drivetrain in these tests, found in periodic logs.

use armid::diagnose::{Cause, Finding, Kind, Verdict};
use armid::robot::Arm;

use crate::hidden::{Hidden, Law};
use crate::simulated::{NOISE, Run, SIGMA_NM, assert_holds, scenario, simulation};

fn only(finding: &Finding, kind: Kind, joint: Option<usize>) -> &Cause {
    let d = &finding.diagnosis;
    println!("{:#?}", d.sentences);
    assert_eq!(
        d.causes.len(),
        1,
        "{:?}",
        d.causes.iter().map(|c| (c.kind, c.joint)).collect::<Vec<_>>()
    );
    let cause = &d.causes[0];
    let in_class = cause.class.iter().any(|c| c == kind.name());
    assert!(cause.kind == kind || in_class, "{} is not {kind}", cause.kind);
    assert_eq!(cause.joint, joint);
    assert_eq!(d.verdict, Verdict::CauseNamed);
    cause
}

/// Angles in steps of 0.1 mrad: rounding repeats in every period, and differentiated it would be half a mrad/s of
/// velocity where joints reverse. Both logs were once said to have unexplained friction, one of them a ripple as well.
#[test]
fn coarse_angles_are_no_friction() {
    let sensors =
        "torque_sd_nm = [0.3, 0.3, 0.25, 0.06, 0.06, 0.06]\nq_sd_rad = 1e-5\nqd_sd_rad_s = 2e-3\n";
    let coarse = "[[effect]]\nkind = \"quantisation\"\nstep = 1e-4\nchannel = \"position\"\n";
    for seed in [52002, 52003] {
        let along = ("ur5_validation", 8);
        let run = Run::new(scenario(("coarse angles", seed), along, sensors, coarse));
        let m = run.log.measurement("coarse");
        let d = run.diagnoser().diagnose(&m, &[], None).unwrap().diagnosis;
        assert_eq!(d.verdict, Verdict::NothingFound, "{:#?}", d.sentences);
    }
}

/// The zero of one current sensor drifts by three times its noise. No law describes this, and the diagnosis must say so
/// first.
#[test]
fn a_zero_that_drifts_is_told_first() {
    let run = Run::new(scenario(("drifting zero", 7), ("ur5_identification", 8), NOISE, ""));
    let mut log = run.log.clone();
    let n = log.torque_nm.samples() as f64;
    for (k, torque) in log.torque_nm.joint_mut(2).iter_mut().enumerate() {
        *torque += 2.0 * (1.0 - (-4.0 * k as f64 / n).exp());
    }
    let m = log.measurement("drifting");
    let d = run.diagnoser().diagnose(&m, &[], None).unwrap().diagnosis;
    assert!(d.causes.is_empty(), "{:#?}", d.sentences);
    assert!(d.sentences[0].starts_with("The mean torque drifts"), "{:#?}", d.sentences);
    assert!(d.sentences[0].contains("(joint 3 by 0."), "{}", d.sentences[0]);
}

/// If something rubs on the motor's side of a wrist's gear, the rotor contributes more to the load than the links.
#[test]
fn load_friction_on_the_motors_side() {
    let found = Hidden::on(4, Law::MotorLoad { mu: 0.15 }).diagnose(3);
    assert_holds(only(&found, Kind::LoadFriction, Some(5)), "mu", 0.15);
}

/// Torque readings above three quarters of the largest torque are cut off. The clipped readings bias the fit of the
/// null model, and the diagnosis corrects this.
#[test]
fn a_reading_that_ends_before_its_noise() {
    let found = Hidden::on(1, Law::CutBeforeNoise { share: 0.74 }).diagnose(8);
    let cause = only(&found, Kind::Saturation, Some(2));
    let most = found.scene.torque_nm.joint(1).iter().fold(0.0f64, |most, t| most.max(t.abs()));
    // The largest torque of the motion is known a hundred times better than this.
    assert!((cause.parameters["limit_nm"].value / most - 0.74).abs() < 0.01);
}

/// A reading that is cut off for a seventh of the time, noise and all: what is beyond the limit reads as the limit, and
/// nothing is left beside the cut.
#[test]
fn a_reading_that_is_cut_off_behind_its_noise() {
    let cut = "[[effect]]\nkind = \"saturation\"\njoint = 3\nlimit_nm = 47.858\n";
    let simulation = simulation(scenario(("cut", 5), ("ur5_validation", 8), NOISE, cut));
    let run = Run::of(&simulation, 0);
    let (read, real) = (run.log.torque_nm.joint(2), simulation.recording.torque_nm.joint(2));
    let beyond = real.iter().zip(read).filter(|(real, _)| real.abs() > 47.858 + 6.0 * SIGMA_NM[2]);
    assert!(beyond.clone().count() > 500);
    assert!(beyond.into_iter().all(|(real, read)| *read == 47.858 * real.signum()));
    let found = run.diagnoser().diagnose(&run.log.measurement("cut"), &[], None).unwrap();
    assert_holds(only(&found, Kind::Saturation, Some(3)), "share_cut", 1.0);
}

/// A ripple of 10 000 σ is fitted to within two thousandths, which a log of so little noise shows. That is no second
/// effect, and no doubt in the first.
#[test]
fn a_law_that_is_not_exact_is_the_law_all_the_same() {
    let quiet = "torque_sd_nm = [0.03, 0.03, 0.02, 0.005, 0.005, 0.005]\nq_sd_rad = 1e-6\nqd_sd_rad_s = 3e-5\n";
    let ripple = "[[effect]]\nkind = \"ripple\"\njoint = 4\namplitude_nm = 0.8\norder_per_turn = 101.0\nphase_rad = 1.5487\n";
    let run = Run::new(scenario(("ripple", 5), ("ur5_validation", 8), quiet, ripple));
    let found = run.diagnoser().diagnose(&run.log.measurement("ripple"), &[], None).unwrap();
    let [cause, others @ ..] = &found.diagnosis.causes[..] else { panic!("nothing is named") };
    assert_eq!((cause.kind, cause.joint), (Kind::Ripple, Some(4)));
    assert!(others.iter().all(|other| other.confidence < 0.001), "{others:?}");
    let amplitude_nm = cause.parameters["amplitude_nm"].value;
    assert!(cause.confidence > 0.99 && (amplitude_nm - 0.8).abs() < 0.008, "{cause:?}");
    let form_error = found.diagnosis.form_error.as_ref().expect("it is not exact to 1 in 10 000");
    assert!(form_error.joint == 4 && form_error.rms_nm < 0.008, "{form_error:?}");
    let said = "On joint 4 the laws named are not exact";
    assert!(found.diagnosis.sentences.iter().any(|sentence| sentence.starts_with(said)));
}

/// Joints with a twelfth of their rotors' inertia stick before they turn round, and move between two samples as their
/// drives let them. A guess of what these give once made concave viscous friction of a Stribeck curve.
#[test]
fn a_light_joint_that_sticks_has_a_stribeck_curve() {
    let curve = "[plant]\ncontrol_rate_hz = 4000.0\nstep_s = 0.00025\n\
                 [[effect]]\nkind = \"stribeck\"\njoint = 5\nextra_nm = 0.7\nvs_rad_s = 0.1\n";
    let scenario = scenario(("light", 3), ("ur5_identification", 6), NOISE, curve);
    let mut arm = scenario.arm.clone();
    arm.joints[3..].iter_mut().for_each(|joint| joint.drive.rotor_inertia_kg_m2 = 0.02);
    let run = Run::new(scenario.with_arm(arm).unwrap());
    let found = run.diagnoser().diagnose(&run.log.measurement("light"), &[], None).unwrap();
    let cause = only(&found, Kind::Stribeck, Some(5));
    assert_holds(cause, "extra_nm", 0.7);
    assert_holds(cause, "vs_rad_s", 0.1);
}

/// A drive whose torque constant is 15 % off, and whose gear rubs under load: the friction is a share of the torque that
/// acts, not of the one that is read. It was once 15 % too large, by nine of its σ.
#[test]
fn beside_a_wrong_torque_constant_friction_keeps_its_size() {
    let hidden = "[[effect]]\nkind = \"load_friction\"\njoint = 3\nmu = 0.08\n\
                  [[effect]]\nkind = \"torque_gain\"\njoint = 3\nerror_fraction = 0.15\n";
    let run = Run::new(scenario(("gain", 3), ("ur5_identification", 8), NOISE, hidden));
    let found = run.diagnoser().diagnose(&run.log.measurement("gain"), &[], None).unwrap();
    let causes = &found.diagnosis.causes;
    assert_eq!(causes.len(), 2, "{:#?}", found.diagnosis.sentences);
    let named = |kind: Kind| {
        let is_it = |c: &&Cause| c.kind == kind && c.joint == Some(3);
        causes.iter().find(is_it).unwrap_or_else(|| panic!("no {kind}"))
    };
    assert_holds(named(Kind::LoadFriction), "mu", 0.08);
    assert_holds(named(Kind::TorqueGain), "error_fraction", 0.15);
}

/// Waves in the current that move no link, at up to 96 Hz: sampled at 125 Hz, their aliases are as high as the waves
/// themselves. The first harmonic of a zigzag has 8/π² of its amplitude.
#[test]
fn ripple_of_the_current_alone() {
    let zigzag = Law::ZigzagOfTheCurrent { height_nm: 0.12, per_turn: 202.0 };
    let found = Hidden::on(3, zigzag).diagnose(9);
    let cause = only(&found, Kind::Ripple, Some(4));
    assert_holds(cause, "order_per_turn", 202.0);
    assert_holds(cause, "amplitude_nm", 0.12 * 8.0 / std::f64::consts::PI.powi(2));
}

#[test]
fn presliding() {
    let found = Hidden::on(3, Law::Dahl { stiffness_per_rad: 300.0 }).diagnose(4);
    let cause = only(&found, Kind::Presliding, Some(4));
    assert_holds(cause, "stiffness_per_rad", 300.0);
    assert_eq!(cause.form, None, "no damping");
}

/// Bristles without a Stribeck curve.
fn damped(stiffness_per_rad: f64, damping_s: f64) -> Law {
    Law::LuGre { stiffness_per_rad, damping_s, extra_nm: 0.0, vs_rad_s: 1.0 }
}

/// A LuGre model whose bristles hold a Stribeck curve. As two laws side by side, the Coulomb friction came out too
/// large by most of the curve, and the curve too small.
#[test]
fn bristles_hold_a_stribeck_curve() {
    for (h, damping_s, seed) in [(3, 0.0, 31), (4, 0.002, 32)] {
        let (extra_nm, vs_rad_s, stiffness_per_rad) = (0.5, 0.15, 1000.0);
        let law = Law::LuGre { stiffness_per_rad, damping_s, extra_nm, vs_rad_s };
        let found = Hidden::on(h, law).diagnose(seed).diagnosis;
        println!("{:#?}", found.sentences);
        let named = |kind: Kind| {
            let is_it = |c: &&Cause| (c.kind, c.joint) == (kind, Some(h + 1));
            found.causes.iter().find(is_it).expect("named")
        };
        let (bristles, curve) = (named(Kind::Presliding), named(Kind::Stribeck));
        assert_eq!(found.causes.len(), 2);
        assert!(found.unexplained.is_none());
        let coulomb_nm = Arm::built_in("ur5").unwrap().joints[h].drive.coulomb_nm;
        for (cause, name, truth) in [
            (bristles, "stiffness_per_rad", stiffness_per_rad),
            (bristles, "coulomb_nm", coulomb_nm),
            (curve, "extra_nm", extra_nm),
            (curve, "vs_rad_s", vs_rad_s),
        ] {
            assert_holds(cause, name, truth);
        }
    }
}

/// Bristles that build up otherwise than in the law are no curve beside it: what they leave is said to be unexplained,
/// and to depend on the way since the reversal.
#[test]
fn bristles_of_other_exponents_have_no_stribeck_curve() {
    for (h, exponent, seed) in [(3, 0.5, 41), (3, 1.5, 42), (4, 2.0, 43), (2, 1.5, 44)] {
        let law = Law::DahlOfExponent { stiffness_per_rad: 600.0, exponent };
        let found = Hidden::on(h, law).diagnose(seed).diagnosis;
        println!("{exponent} on {}: {:#?}", h + 1, found.sentences);
        let is_curve = |c: &Cause| c.kind == Kind::Stribeck && c.confidence > 0.5;
        assert!(!found.causes.iter().any(is_curve), "{exponent} on joint {}", h + 1);
        let unexplained = found.unexplained.expect("the law is another one");
        assert_eq!((unexplained.joint, unexplained.axis), (h + 1, "way since the reversal"));
    }
}

/// A LuGre model: damping makes bristles look stiffer than they are, and fewer.
#[test]
fn presliding_of_damped_bristles() {
    let law = damped(600.0, 0.006);
    let found = Hidden::on(3, law).diagnose(14);
    let cause = only(&found, Kind::Presliding, Some(4));
    let truth = [("stiffness_per_rad", 600.0), ("damping_s", 0.006), ("coulomb_nm", 1.6)];
    truth.into_iter().for_each(|(name, truth)| assert_holds(cause, name, truth));
    assert_eq!(cause.form, Some("damped bristles"));
}

/// Damping that the log does not show (1.5 of its standard error) moves the stiffness by more than the noise alone
/// would allow.
#[test]
fn presliding_of_hardly_damped_bristles() {
    let law = damped(600.0, 0.0007);
    let hidden = Hidden::on(3, law);
    let run = hidden.run();
    for seed in [21, 22, 23] {
        let found = hidden.diagnose_run(&run, seed);
        let cause = only(&found, Kind::Presliding, Some(4));
        for (name, truth) in [("stiffness_per_rad", 600.0), ("coulomb_nm", 1.6)] {
            let [low, high] = cause.parameters[name].ci95;
            assert!(low < truth && truth < high, "{seed}: {name} {low} … {high}");
        }
    }
}

/// Bristles that yield within 0.1 mrad, which is one sample at 125 Hz; a fast log resolves them.
#[test]
fn stiff_presliding_in_a_fast_log() {
    let hidden = Hidden::on(2, Law::Dahl { stiffness_per_rad: 10_000.0 }).logged_at(500.0);
    let found = hidden.diagnose(5);
    assert_holds(only(&found, Kind::Presliding, Some(3)), "stiffness_per_rad", 10_000.0);
}

/// The same sampled at 125 Hz: the stiffness follows from the torque of the drive while the joint reverses, for any
/// share of friction fed forward and any offset of the velocities. Only the feedback bandwidth of the drive is assumed,
/// which changes the stiffness by at most 2 %; noise of a thirtieth of the usual changes it by less than a thousandth.
/// (With even less noise, the approximations in all other laws matter too, which takes longer.)
#[test]
fn stiff_presliding_behind_a_drive_that_feeds_friction() {
    let hidden = || Hidden::on(3, Law::Dahl { stiffness_per_rad: 10_000.0 }).with_noise(0.03);
    let (usual, half_fed) = (hidden(), hidden().fed_forward(0.5));
    let (run, half_fed_run) = (usual.run(), half_fed.run());
    let offset = hidden().with_velocity_offset(0.02);
    for (hidden, run, seed) in
        [(usual, &run, 11), (half_fed, &half_fed_run, 12), (offset, &run, 13)]
    {
        let found = hidden.diagnose_run(run, seed).diagnosis;
        let cause = found.causes.iter().find(|c| (c.kind, c.joint) == (Kind::Presliding, Some(4)));
        let parameters = &cause.expect("named").parameters;
        for (parameter, truth) in [("stiffness_per_rad", 10_000.0), ("coulomb_nm", 1.6)] {
            let off = parameters[parameter].value / truth - 1.0;
            assert!(off.abs() < 0.02, "{seed}: {parameter} is off by {off}");
        }
    }
}

/// The joint reverses within two samples of this log: the response of the drive between them must not be mistaken for a
/// late reading.
#[test]
fn a_late_reading_of_a_sharp_reversal() {
    let found = Hidden::on(0, Law::Late { ms: 2 }).logged_at(250.0).diagnose(10);
    assert_holds(only(&found, Kind::TimeSkew, Some(1)), "delay_s", 0.002);
}

/// A drive that smooths the torque it reports: one cause, and its form says that it is no delay.
#[test]
fn a_torque_that_went_through_a_low_pass() {
    let found = Hidden::on(3, Law::LowPass { ms: 5.0 }).diagnose(14);
    let cause = only(&found, Kind::TimeSkew, Some(4));
    assert_holds(cause, "delay_s", 0.005);
    assert!(cause.form.is_some_and(|form| form.contains("low-pass")), "{:?}", cause.form);
}

/// The load of the gear of joint 2 depends on its rotor, whose inertia the motion adds to that of the links. Friction
/// that grows with the load tells it: with the rotor of the file, or none, mu would be off by many σ.
#[test]
fn load_friction_of_a_gear_with_another_rotor() {
    let rotor_kg_m2 = Arm::built_in("ur5").unwrap().joints[1].drive.rotor_inertia_kg_m2;
    for (share, seed) in [(1.4, 15), (0.0, 16)] {
        let hidden = Hidden::on(1, Law::Load { mu: 0.1 }).with_rotor_in_the_file(share);
        let found = hidden.diagnose(seed);
        let cause = only(&found, Kind::LoadFriction, Some(2));
        assert_holds(cause, "mu", 0.1);
        assert_holds(cause, "rotor_inertia_kg_m2", rotor_kg_m2);
    }
}

/// Five gaps of a tenth to four tenths of a second: the other periods reveal what is missing, and the whole log is
/// used.
#[test]
fn gaps_of_a_log_that_repeats() {
    let lost = [1203..1223, 2790..2841, 4125..4144, 6000..6012, 8700..8733];
    let found = Hidden::on(1, Law::Load { mu: 0.03 }).without_rows(&lost).diagnose(2);
    let d = &found.diagnosis;
    let named: Vec<_> = d.causes.iter().map(|c| (c.kind, c.joint)).collect();
    assert_eq!(named, [(Kind::DroppedSamples, None), (Kind::LoadFriction, Some(2))]);
    assert_holds(&d.causes[1], "mu", 0.03);
    assert!(d.warnings.iter().any(|w| w.contains("5 gaps")), "{:?}", d.warnings);
}

/// Only Coulomb and viscous friction: reversals are as sharp in the log as in the drive.
#[test]
fn a_fast_log_of_a_good_model_has_no_cause() {
    let found = Hidden::on(1, Law::Load { mu: 0.0 }).logged_at(500.0).diagnose(6);
    assert_eq!(found.diagnosis.verdict, Verdict::NothingFound, "{:?}", found.diagnosis.sentences);
}
