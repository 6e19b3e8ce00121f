//! Hide and find: effects of the plant that a diagnosis once confused with others must be named from the log alone.
//! `blind_benchmark` tests one effect of each family with random joint and size.

use armid::diagnose::candidates::{self, Candidate};
use armid::diagnose::{Cause, Diagnosis, Kind, Verdict};
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

use crate::simulated::{NOISE, Run, SIGMA_NM, assert_holds, scenario, simulation};

/// Diagnoses a log with white noise and the effects in `toml`.
fn diagnose(seed: u64, toml: &str) -> Diagnosis {
    diagnose_along("ur5_identification", seed, toml)
}

/// The same along another motion.
fn diagnose_along(trajectory: &str, seed: u64, toml: &str) -> Diagnosis {
    diagnose_rows(trajectory, seed, toml, |samples, _| (0..samples).collect())
}

/// The same with a selection of `rows`, drawn from the number of all rows by a random generator.
fn diagnose_rows(
    trajectory: &str,
    seed: u64,
    toml: &str,
    rows: impl Fn(usize, &mut ChaCha8Rng) -> Vec<usize>,
) -> Diagnosis {
    diagnose_by(candidates::all(), (trajectory, seed, toml), rows)
}

/// The same with only these families in the dictionary.
fn diagnose_by(
    families: Vec<Box<dyn Candidate>>,
    (trajectory, seed, toml): (&str, u64, &str),
    rows: impl Fn(usize, &mut ChaCha8Rng) -> Vec<usize>,
) -> Diagnosis {
    let mut run = Run::new(scenario(("blind", seed), (trajectory, 6), NOISE, toml));
    let rows = rows(run.log.time_s.len(), &mut ChaCha8Rng::seed_from_u64(seed));
    let log = &mut run.log;
    log.time_s = rows.iter().map(|&row| log.time_s[row]).collect();
    for signals in [&mut log.q_rad, &mut log.qd_rad_s, &mut log.torque_nm] {
        *signals = signals.map_joints(|_, y| rows.iter().map(|&row| y[row]).collect());
    }
    let mut diagnoser = run.diagnoser_with(families);
    diagnoser.diagnose(&run.log.measurement("blind"), &[], None).unwrap().diagnosis
}

/// Diagnoses a log with one effect of `kind` with `parameters`, at a joint drawn from `joints`.
fn hide(seed: u64, kind: &str, joints: &[usize], parameters: &str) -> (usize, Diagnosis) {
    let joint = joints[ChaCha8Rng::seed_from_u64(seed).random_range(0..joints.len())];
    let toml = format!("[[effect]]\nkind = \"{kind}\"\njoint = {joint}\n{parameters}\n");
    (joint, diagnose(seed, &toml))
}

/// Whether the strongest cause is `kind` (or its class) at `joint`.
fn is_named(d: &Diagnosis, kind: &str, joint: Option<usize>) -> bool {
    println!("{kind} at {joint:?}: {:?} {:#?}", d.verdict, d.sentences);
    let strongest = d.causes.iter().max_by(|a, b| a.strength.total_cmp(&b.strength));
    strongest.is_some_and(|c| {
        c.joint == joint && (c.kind.name() == kind || c.class.iter().any(|k| k == kind))
    })
}

/// A well-damped gear with the encoder on the link: rotor and friction move more than the log shows.
#[test]
fn a_gear_that_gives_way_is_seen_from_the_link_as_well() {
    let gear = "stiffness_nm_rad = 8000.0\ndamping_ratio = 0.3\nencoder = \"link\"";
    let (joint, d) = hide(112, "elasticity", &[2, 3], gear);
    assert!(is_named(&d, "elasticity", Some(joint)));
    assert_holds(&d.causes[0], "stiffness_nm_rad", 8000.0);
    let [low, high] = d.causes[0].parameters["stiffness_nm_rad"].ci95;
    assert!(high - low < 4000.0, "{low} … {high}");
}

/// Drives without friction feed-forward let the joint respond to friction. The motion is then full of fast harmonics
/// that excite a soft gear and blur a late velocity. The hidden effect is all that is named, several σ strong.
#[test]
fn drives_that_feed_no_friction_forward_hide_nothing() {
    let drive = "[plant]\nfriction_feedforward = 0.0\n";
    for (kind, joint, key, truth) in [
        ("elasticity", Some(2), "stiffness_nm_rad", 8000.0),
        ("velocity_lag", None, "delay_s", 0.003),
    ] {
        let site = joint.map_or(String::new(), |j| format!("joint = {j}\n"));
        let effect = format!("{drive}[[effect]]\nkind = \"{kind}\"\n{site}{key} = {truth:?}\n");
        let d = diagnose(120, &effect);
        let named: Vec<_> = d.causes.iter().map(|c| (c.kind.name(), c.joint)).collect();
        assert_eq!(named, [(kind, joint)]);
        assert_holds(&d.causes[0], key, truth);
        assert!(d.unexplained.is_none());
    }
}

/// The parameters take over all of these but a few percent, which stand out of the noise by 15 to 25 σ and were told as
/// springs and gains of other joints.
#[test]
fn what_the_parameters_nearly_hide_is_named() {
    for (seed, kind, joint, key, truth) in [
        (130, "link_length", Some(3), "error_m", 0.01),
        (131, "torque_gain", Some(5), "error_fraction", -0.2),
        (132, "gravity", None, "g_m_s2", 9.5),
    ] {
        let site = joint.map_or(String::new(), |j| format!("joint = {j}\n"));
        let d =
            diagnose(seed, &format!("[[effect]]\nkind = \"{kind}\"\n{site}{key} = {truth:?}\n"));
        let named: Vec<_> = d.causes.iter().map(|c| (c.kind.name(), c.joint)).collect();
        assert_eq!(named, [(kind, joint)], "{:?}", d.sentences);
        assert_holds(&d.causes[0], key, truth);
        assert!(d.unexplained.is_none());
    }
}

#[test]
fn late_torque_belongs_to_the_whole_arm() {
    let d = diagnose(2, "[[effect]]\nkind = \"time_skew\"\ndelay_s = 0.002\n");
    assert!(is_named(&d, "time_skew", None));
    assert_holds(&d.causes[0], "delay_s", 0.002);
}

/// Diagnoses of `logs` logs of an arm without effects; `rest` describes its drives and sensors.
fn clean(trajectory: &str, rest: &str, logs: u64) -> impl Iterator<Item = Diagnosis> {
    let simulation = simulation(scenario(("blind", 0), (trajectory, 6), NOISE, rest));
    (0..logs).map(move |trial| {
        let run = Run::of(&simulation, trial);
        run.diagnoser().diagnose(&run.log.measurement("clean"), &[], None).unwrap().diagnosis
    })
}

/// Sensors with this share of a UR5's noise.
fn sensors(share: f64) -> String {
    let torque_nm = SIGMA_NM.map(|sd| share * sd);
    let (q, qd) = (share * 2e-5, share * 1e-3);
    format!("torque_sd_nm = {torque_nm:?}\nq_sd_rad = {q:?}\nqd_sd_rad_s = {qd:?}\n")
}

/// With so little noise, the approximations in the model of how drives respond to friction stand out by 10 σ and more.
/// They were once named as a Stribeck curve, another reversal width and a late torque.
#[test]
fn what_is_approximate_at_reversals_has_no_name() {
    let quiet = scenario(("quiet", 11), ("ur5_identification", 8), &sensors(1.0 / 20.0), "");
    let simulation = simulation(quiet);
    for trial in 0..2 {
        let run = Run::of(&simulation, trial);
        let d =
            run.diagnoser().diagnose(&run.log.measurement("quiet"), &[], None).unwrap().diagnosis;
        assert!(d.causes.is_empty(), "{:?}", d.sentences);
    }
}

/// A wrong gain does not change how friction reverses; yet reversal widths were once named beside it, with 46 σ.
/// Likewise, a joint that jolts does not have a stiff gear; one was once named with 6 σ, because the noise of the
/// acceleration is correlated with the residual.
#[test]
fn nothing_stands_beside_a_gain() {
    let half_fed = "[plant]\nbandwidth_rad_s = 50.0\nfriction_feedforward = 0.5\n\
                    [[effect]]\nkind = \"torque_gain\"\njoint = 2\nerror_fraction = 0.03\n";
    let run = Run::new(scenario(("quiet", 11), ("ur5_identification", 8), &sensors(0.1), half_fed));
    let d = run.diagnoser().diagnose(&run.log.measurement("quiet"), &[], None).unwrap().diagnosis;
    assert!(is_named(&d, "torque_gain", Some(2)));
    assert_eq!(d.causes.len(), 1, "{:?}", d.sentences);
}

/// Four logs; `blind_benchmark` has ten more.
#[test]
fn clean_logs_have_no_cause() {
    for d in clean("ur5_identification", "", 4) {
        assert_eq!(d.verdict, Verdict::NothingFound, "{:?}", d.sentences);
        // The residual is noise, minus the share that about ten parameters per joint take from 1250 samples. Its size
        // is known to 1/√(2·1250), and the scatter of five periods is known less precisely: five σ of both together are
        // one part in six.
        let noise_nm = d.noise_of_mean_nm.as_ref().expect("the motion repeats");
        for (left, noise) in d.before.rms_nm.iter().zip(noise_nm) {
            assert!((left / noise - 1.0).abs() < 0.16, "{left} Nm left of noise of {noise} Nm");
        }
    }
}

/// Controllers that do not compensate friction: where friction reverses, the torque follows late and the links jerk.
#[test]
fn how_drives_answer_friction_is_no_cause() {
    for (feedforward, logs) in [(0.0, 2), (0.5, 1)] {
        let drives = format!("[plant]\nfriction_feedforward = {feedforward:?}");
        for d in clean("ur5_identification", &drives, logs) {
            assert_eq!(d.verdict, Verdict::NothingFound, "{:?}", d.sentences);
        }
    }
}

/// Friction that is sharper than the samples resolve, with drives that expect other friction and with drives that do
/// not compensate any. One reversal width is all that is named.
#[test]
fn sharp_friction_is_one_cause() {
    for (seed, feedforward) in [(50, 0.9), (51, 0.0)] {
        let d = diagnose(
            seed,
            &format!(
                "[plant]\nfriction_feedforward = {feedforward:?}\n\
                 [[effect]]\nkind = \"reversal_width\"\nwidth_rad_s = 0.003\n"
            ),
        );
        let named: Vec<_> = d.causes.iter().map(|c| (c.kind.name(), c.joint)).collect();
        assert_eq!(named, [("reversal_width", None)], "{:?}", d.sentences);
        // Of so sharp a reversal, only an upper bound of the width is known; apart from that, as in `assert_holds`.
        let width = &d.causes[0].parameters["width_rad_s"];
        let [low, high] = width.ci95;
        assert!((width.value - 0.003).abs() < high - low && high < 0.01, "{width:?}");
    }
}

/// Effects that are over within one sample at 125 Hz: bristles that yield within 0.1 mrad, and the torque of one joint
/// recorded 1.3 ms late. Each looks like the other in samples of friction; both must be named with the right value.
#[test]
fn what_is_over_within_a_sample() {
    let cases = [
        ("presliding", 3, "stiffness_per_rad", 10_000.0),
        ("presliding", 5, "stiffness_per_rad", 5000.0),
        ("time_skew", 3, "delay_s", 0.0013),
        ("time_skew", 4, "delay_s", 0.0010),
    ];
    for (seed, (kind, joint, parameter, truth)) in (30..).zip(cases) {
        let (_, d) = hide(seed, kind, &[joint], &format!("{parameter} = {truth:?}"));
        assert!(is_named(&d, kind, Some(joint)));
        assert_eq!(d.causes.len(), 1, "{:?}", d.sentences);
        assert_holds(&d.causes[0], parameter, truth);
    }
}

/// Along this motion joint 1 reverses rarely and always at about the same acceleration. Bristles that yield within 0.1
/// mrad would then look like a particular response of the drive to friction, if a drive could be 4.5 ms ahead of its
/// joint.
#[test]
fn what_no_drive_answers_is_friction() {
    let stiff = "[[effect]]\nkind = \"presliding\"\njoint = 1\nstiffness_per_rad = 10000.0";
    let d = diagnose_along("ur5_validation", 40, stiff);
    assert!(is_named(&d, "presliding", Some(1)));
}

/// Rotor and link of joint 3 oscillate against each other at 300 rad/s √(1 + Ia/M), with Ia = 1.6 and M about 1 kg m².
/// This is above the Nyquist frequency of the log, so that the samples depend on the exact frequency.
#[test]
fn play_that_rings_faster_than_the_log() {
    let (_, d) = hide(41, "backlash", &[3], "gap_rad = 6e-5");
    assert!(is_named(&d, "backlash", Some(3)));
}

/// Two hundred waves per turn at 3 rad/s are 95 Hz, above the Nyquist frequency of the log: most of what the samples
/// show are aliases. The second order belongs to no gear and must be found by a search over all orders.
#[test]
fn ripple_that_is_faster_than_the_log() {
    let cases =
        [(44, "ur5_identification", 4, 202.0, 0.12), (45, "ur5_validation", 2, 195.05, 0.8)];
    for (seed, trajectory, joint, order, amplitude) in cases {
        let toml = format!(
            "[[effect]]\nkind = \"ripple\"\njoint = {joint}\norder_per_turn = {order:?}\n\
             amplitude_nm = {amplitude}\nphase_rad = 1.1"
        );
        let d = diagnose_along(trajectory, seed, &toml);
        assert!(is_named(&d, "ripple", Some(joint)));
        assert_eq!(d.causes.len(), 1, "{:?}", d.sentences);
        assert_holds(&d.causes[0], "amplitude_nm", amplitude);
        assert_holds(&d.causes[0], "order_per_turn", order);
    }
}

/// Friction that falls by a tenth within a minute changes more between periods than a touching hand would cause.
#[test]
fn warming_is_no_contact() {
    let drift = "fraction = -0.1\ntime_constant_s = 40.0";
    for seed in [40, 41] {
        let (joint, d) = hide(seed, "thermal_drift", &[1, 2, 3, 6], drift);
        assert!(is_named(&d, "thermal_drift", Some(joint)));
        assert_eq!(d.causes.len(), 1, "{:?}", d.sentences);
    }
}

/// If the friction of a joint changes fast, its first periods do not repeat the later ones and are left out. The
/// friction is nevertheless stated for the start of the log.
#[test]
fn warming_begins_with_the_log() {
    let toml = "[[effect]]\nkind = \"thermal_drift\"\njoint = 4\nfraction = 0.25\n\
                time_constant_s = 23.0";
    let d = diagnose_along("ur5_validation", 1, toml);
    assert!(is_named(&d, "thermal_drift", Some(4)));
    assert_holds(&d.causes[0], "fraction", 0.25);
    let [low, high] = d.causes[0].parameters["fraction"].ci95;
    assert!(high - low < 0.2, "{low} … {high}");
}

/// More friction near standstill changes the torque almost as a drive does that feeds forward another share of
/// friction.
#[test]
fn friction_near_rest_is_no_odd_drive() {
    let toml = "[[effect]]\nkind = \"stribeck\"\njoint = 1\nextra_nm = 3.2\nvs_rad_s = 0.06";
    let d = diagnose_along("ur5_identification", 7, toml);
    assert!(is_named(&d, "stribeck", Some(1)));
    assert_eq!(d.causes.len(), 1, "{:?}", d.sentences);
}

/// A Stribeck curve that falls within two widths of the sign function lies between two shapes of the first search. A
/// narrower curve with the other exponent, which is not an allowed shape, explains more than either of the two.
#[test]
fn friction_near_rest_that_falls_at_once() {
    let toml = "[[effect]]\nkind = \"stribeck\"\njoint = 4\nextra_nm = 1.25\nvs_rad_s = 0.0347\nexponent = 2";
    let d = diagnose_along("ur5_validation", 5, toml);
    assert!(is_named(&d, "stribeck", Some(4)), "{:?}", d.sentences);
    assert_eq!(d.causes.len(), 1, "{:?}", d.sentences);
}

/// Stribeck curves on several joints look like a sharper reversal of all joints with too much friction.
#[test]
fn friction_near_rest_of_several_joints() {
    let joints = [3, 4, 5, 6];
    let curve = |joint: usize| {
        let extra_nm = if joint < 4 { 3.0 } else { 0.45 };
        format!(
            "[[effect]]\nkind = \"stribeck\"\njoint = {joint}\nextra_nm = {extra_nm:?}\nvs_rad_s = 0.05\n\
             exponent = 2\n"
        )
    };
    let d = diagnose_along("ur5_validation", 5, &joints.map(curve).concat());
    let mut named: Vec<_> = d.causes.iter().map(|c| (c.kind, c.joint)).collect();
    named.sort_by_key(|(_, joint)| *joint);
    assert_eq!(named, joints.map(|j| (Kind::Stribeck, Some(j))), "{:?}", d.sentences);
}

/// If a Stribeck curve is present but not in the dictionary, a sharper reversal with too much friction explains much of
/// it. The diagnosis must then report something unexplained, not a sharp reversal.
#[test]
fn friction_near_rest_is_no_width() {
    let curve = |joint: usize, extra_nm: f64, vs_rad_s: f64| {
        format!(
            "[[effect]]\nkind = \"stribeck\"\njoint = {joint}\nextra_nm = {extra_nm:?}\n\
             vs_rad_s = {vs_rad_s:?}\nexponent = 2"
        )
    };
    for (seed, toml) in [(31, curve(3, 4.8, 0.031)), (32, curve(6, 0.4, 0.04))] {
        let mut families = candidates::all();
        families.retain(|family| family.kind() != Kind::Stribeck);
        let log = ("ur5_validation", seed, &*toml);
        let d = diagnose_by(families, log, |samples, _| (0..samples).collect());
        assert_eq!(d.verdict, Verdict::Unexplained, "{:?}", d.sentences);
        assert!(d.causes.is_empty(), "{:?}", d.sentences);
    }
}

/// Concave friction of which the model absorbs all but a twenty-fifth, the smallest remainder that is searched for.
/// Once it is found, it does not matter that slightly more or less of it remains beside the next estimate of the arm.
#[test]
fn friction_that_the_model_nearly_absorbs() {
    let toml =
        "[[effect]]\nkind = \"nonlinear_viscous\"\njoint = 2\namplitude_nm = 6.4\nexponent = 0.64";
    let d = diagnose_along("ur5_validation", 1, toml);
    assert!(is_named(&d, "nonlinear_viscous", Some(2)), "{:?}", d.sentences);
    assert_eq!(d.causes.len(), 1, "{:?}", d.sentences);
}

/// One drive without friction feed-forward among five that feed forward nine tenths.
#[test]
fn a_drive_that_feeds_nothing_forward() {
    let toml = "[[effect]]\nkind = \"feed_forward\"\njoint = 1\nshare_less = 0.9";
    let d = diagnose_along("ur5_identification", 3, toml);
    assert!(is_named(&d, "feed_forward", Some(1)));
    assert_eq!(d.causes.len(), 1, "{:?}", d.sentences);
    assert_holds(&d.causes[0], "share_less", 0.9);
}

/// No controller knows the friction of its joints to better than a tenth: feed-forward shares that differ by that much
/// are not a cause, and must not be mistaken for friction near standstill.
#[test]
fn drives_that_differ_as_drives_do() {
    let of_joint = |(j, less): (usize, &f64)| {
        format!("[[effect]]\nkind = \"feed_forward\"\njoint = {}\nshare_less = {less:?}\n", j + 1)
    };
    let less = [0.1, -0.1, 0.1, -0.1, 0.1, -0.1];
    let toml: String = less.iter().enumerate().map(of_joint).collect();
    for trajectory in ["ur5_identification", "ur5_validation"] {
        let d = diagnose_along(trajectory, 3, &toml);
        assert_eq!(d.verdict, Verdict::NothingFound, "{:?}", d.sentences);
    }
}

/// Rows 6, 8 and 10 ms apart with correct time stamps: uneven sampling is not physics.
#[test]
fn an_uneven_clock_is_no_cause() {
    let d = diagnose_rows(
        "ur5_identification",
        7,
        "[plant]\nlog_rate_hz = 500.0",
        |samples, random| {
            let mut rows = vec![0];
            while let Some(last) = rows.last().filter(|last| **last + 5 < samples) {
                rows.push(last + [3, 4, 4, 4, 5][random.random_range(0..5)]);
            }
            rows
        },
    );
    assert!(d.noise_floor_nm.is_some(), "the motion repeats");
    assert_eq!(d.verdict, Verdict::NothingFound, "{:?}", d.sentences);
}

/// Fast logs contain more velocity noise, and coloured torque noise is weaker at the same frequencies. Noise of the
/// acceleration, which is in both the candidates and the residual, then shows first; once, eight of ten such logs had
/// something unexplained. At the designed rate of false alarms, three good logs fail once in 170.
#[test]
fn fast_logs_with_coloured_noise_have_no_cause() {
    let noise = r#"
        [sensors.torque_noise]
        components = [
            { share = 0.5, colour = "white" },
            { share = 0.3, colour = { ar1 = { time_constant_s = 0.02 } } },
            { share = 0.2, colour = { ar1 = { time_constant_s = 1.0 } } },
        ]
        cross_joint_correlation = 0.3
        [plant]
        log_rate_hz = 250.0
    "#;
    for d in clean("ur5_validation", noise, 3) {
        assert_eq!(d.verdict, Verdict::NothingFound, "{:?}", d.sentences);
    }
}

/// Along this motion joint 1 turns by little more than a radian: the mean of the friction over this arc looks like
/// Coulomb friction, and only its variation is visible.
#[test]
fn friction_that_depends_on_an_angle_of_a_small_arc() {
    let toml = "[[effect]]\nkind = \"position_friction\"\njoint = 1\namplitude_nm = 0.8\nphase_rad = -1.0\n";
    let d = diagnose_along("ur5_validation", 7, toml);
    assert!(is_named(&d, "position_friction", Some(1)));
    assert_eq!(d.causes.len(), 1, "{:?}", d.sentences);
    assert_holds(&d.causes[0], "amplitude_nm", 0.8);
    assert_holds(&d.causes[0], "phase_rad", -1.0);
}

/// All friction of a joint warms up, and all of its dry friction turns round at once: the law that multiplies the rest
/// and the law that adds to it are both named, and nothing else, with intervals that hold the truth.
#[test]
fn friction_that_multiplies_other_friction() {
    let warming = ("thermal_drift", [("fraction", -0.25), ("time_constant_s", 50.0)].as_slice());
    let width = ("reversal_width", [("width_rad_s", 0.05)].as_slice());
    let load = ("load_friction", [("mu", 0.1)].as_slice());
    let place = ("position_friction", [("amplitude_nm", 0.8), ("phase_rad", 0.5)].as_slice());
    let near_rest = |extra_nm| [("extra_nm", extra_nm), ("vs_rad_s", 0.2)];
    let (strong, weak) = (near_rest(5.0), near_rest(1.2));
    for (seed, joints, laws) in [
        (801, [2, 3], [warming, load]),
        (802, [2, 3], [warming, ("stribeck", strong.as_slice())]),
        (803, [4, 5], [warming, place]),
        (804, [4, 5], [warming, width]),
        (805, [2, 3], [width, load]),
        (806, [4, 6], [width, ("stribeck", weak.as_slice())]),
    ] {
        let joint = joints[ChaCha8Rng::seed_from_u64(seed).random_range(0..joints.len())];
        let toml = |(kind, parameters): (&str, &[(&str, f64)])| {
            let lines = parameters.iter().map(|(name, value)| format!("{name} = {value:?}\n"));
            format!("[[effect]]\nkind = \"{kind}\"\njoint = {joint}\n{}", lines.collect::<String>())
        };
        let d = diagnose(seed, &laws.map(toml).concat());
        println!("{laws:?} at joint {joint}: {:#?}", d.sentences);
        assert_eq!((d.causes.len(), d.unexplained.is_some()), (2, false));
        for (kind, parameters) in laws {
            let is_it = |c: &&Cause| (c.kind.name(), c.joint) == (kind, Some(joint));
            let cause = d.causes.iter().find(is_it).unwrap();
            parameters.iter().for_each(|(name, truth)| assert_holds(cause, name, *truth));
        }
    }
}

/// A wide Stribeck curve and concave friction stand for each other so well that nothing is left to explain. Where the
/// law of the arm is not in the dictionary, the other may be named, but not for certain; where both are, the right one
/// is.
#[test]
fn what_other_laws_imitate_is_not_named_for_certain() {
    let stribeck = "kind = \"stribeck\"\nextra_nm = 2.2\nvs_rad_s = 0.26";
    let concave = "kind = \"nonlinear_viscous\"\namplitude_nm = -6.0\nexponent = 0.5";
    for (seed, kind, law) in
        [(611, Kind::Stribeck, stribeck), (612, Kind::NonlinearViscous, concave)]
    {
        let toml = format!("[[effect]]\njoint = 2\n{law}\n");
        let mut families = candidates::all();
        families.retain(|family| family.kind() != kind);
        let log = ("ur5_validation", seed, &*toml);
        let d = diagnose_by(families, log, |samples, _| (0..samples).collect());
        println!("without {kind}: {:?} {:#?}", d.verdict, d.sentences);
        assert!(d.unexplained.is_some() || d.causes.iter().all(|c| c.confidence <= 0.9));
        assert!(is_named(&diagnose_along("ur5_validation", seed, &toml), kind.name(), Some(2)));
    }
}

/// A link that is longer than the model says does to one joint what it does not do to the others. Where lengths and
/// gravity are not in the dictionary, a spring and the gain of a drive explain most of that on joint 3, and no joint
/// shows the rest by itself.
#[test]
fn what_acts_on_the_whole_arm_is_not_silently_the_fault_of_a_joint() {
    let toml = "[[effect]]\nkind = \"link_length\"\njoint = 3\nerror_m = 0.009\n";
    let mut families = candidates::all();
    families.retain(|family| !matches!(family.kind(), Kind::LinkLength | Kind::Gravity));
    let d = diagnose_by(families, ("ur5_identification", 821, toml), |samples, _| {
        (0..samples).collect()
    });
    println!("{:#?}", d.sentences);
    let unknown = d.unexplained.expect("no name is right");
    assert!(unknown.of_all_joints, "{unknown:?}");
    assert!(d.sentences.iter().any(|sentence| sentence.starts_with("The joints together show")));
    assert!(!d.causes.is_empty() && d.causes.iter().all(|cause| cause.confidence <= 0.5));
}

/// Friction that falls with a power of the speed is Stribeck friction in a form of its own, and its size is that of the
/// form.
#[test]
fn friction_that_falls_slowly_far_from_rest() {
    let toml = "[[effect]]\nkind = \"stribeck\"\njoint = 3\nextra_nm = 1.6\nvs_rad_s = 0.09\nfall = \"rational\"\n";
    let d = diagnose_along("ur5_validation", 621, toml);
    assert!(is_named(&d, "stribeck", Some(3)));
    assert_eq!((d.causes.len(), d.unexplained.is_some()), (1, false), "{:?}", d.sentences);
    assert_holds(&d.causes[0], "extra_nm", 1.6);
    assert_holds(&d.causes[0], "vs_rad_s", 0.09);
}
