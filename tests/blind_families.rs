//! Hide and find: effects of the plant that a diagnosis once confused with others must be named from the log alone.
//! `blind_friction` does the same with laws of friction; `blind_benchmark` tests one effect of each family with random
//! joint and size.

use armid::diagnose::{Diagnosis, Kind, Verdict, candidates};
use rand::RngExt;

use crate::blind::{diagnose, diagnose_along, diagnose_by, diagnose_rows, hide, is_named};
use crate::simulated::{NOISE, Run, SIGMA_NM, assert_holds, scenario, simulation};

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
