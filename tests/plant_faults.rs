//! Hidden effects of the plant, checked against the physics they must obey.

use armid::excitation::{FourierSeries, Reference};
use armid::plant::faults::{Effect, FaultyPlant};
use armid::plant::{Measured, Plant, PlantConfig, PlantError, Recording, SensorConfig, Sensors};
use armid::random::TrialStreams;
use armid::robot::Arm;

use crate::simulated;

fn ur5() -> Arm {
    Arm::built_in("ur5").unwrap()
}

/// A motion cut off after `duration_s`.
struct Start<R> {
    motion: R,
    duration_s: f64,
}

impl<R: Reference> Reference for Start<R> {
    fn joints(&self) -> usize {
        self.motion.joints()
    }

    fn duration_s(&self) -> f64 {
        self.duration_s
    }

    fn sample(&self, t_s: f64, q_rad: &mut [f64], qd_rad_s: &mut [f64], qdd_rad_s2: &mut [f64]) {
        self.motion.sample(t_s, q_rad, qd_rad_s, qdd_rad_s2);
    }
}

fn lively() -> Start<FourierSeries> {
    Start { motion: FourierSeries::built_in("ur5_identification").unwrap(), duration_s: 1.0 }
}

/// Effects whose keys are `tables`.
fn effects(tables: &[&str]) -> Vec<Effect> {
    let text: String = tables.iter().map(|t| format!("[[effect]]\n{t}\n")).collect();
    simulated::effects(&text)
}

fn plant(tables: &[&str]) -> Result<FaultyPlant, PlantError> {
    FaultyPlant::new(&ur5(), &effects(tables), &PlantConfig::default())
}

fn run(tables: &[&str], reference: &dyn Reference) -> Recording {
    plant(tables).unwrap().run(reference, None).unwrap()
}

/// Every kind of effect, in the order of [`Effect::KINDS`], with a size that a log shows and, where it exists, with a
/// size that has no effect.
const KINDS: [(&str, Option<&str>); 29] = [
    (
        "kind='stribeck'\njoint=4\nextra_nm=0.5\nvs_rad_s=0.1",
        Some("kind='stribeck'\njoint=4\nextra_nm=0\nvs_rad_s=0.1"),
    ),
    (
        "kind='nonlinear_viscous'\njoint=1\namplitude_nm=3\nexponent=0.5",
        Some("kind='nonlinear_viscous'\njoint=1\namplitude_nm=0\nexponent=0.5"),
    ),
    (
        "kind='asymmetric_friction'\njoint=2\ncoulomb_nm=0.5\nviscous_nm_s_rad=0.4",
        Some("kind='asymmetric_friction'\njoint=2\ncoulomb_nm=0\nviscous_nm_s_rad=0"),
    ),
    ("kind='load_friction'\njoint=2\nmu=0.06", Some("kind='load_friction'\njoint=2\nmu=0")),
    ("kind='presliding'\njoint=5\nstiffness_per_rad=1000", None),
    ("kind='reversal_width'\nwidth_rad_s=0.005", Some("kind='reversal_width'\nwidth_rad_s=0.02")),
    (
        "kind='position_friction'\njoint=3\namplitude_nm=0.7\nphase_rad=1",
        Some("kind='position_friction'\njoint=3\namplitude_nm=0\nphase_rad=1"),
    ),
    (
        "kind='thermal_drift'\njoint=1\nfraction=-0.2\ntime_constant_s=20",
        Some("kind='thermal_drift'\njoint=1\nfraction=0\ntime_constant_s=20"),
    ),
    (
        "kind='friction_change'\njoint=1\ncoulomb_nm=-1\nviscous_nm_s_rad=2",
        Some("kind='friction_change'\njoint=1\ncoulomb_nm=0\nviscous_nm_s_rad=0"),
    ),
    (
        "kind='ripple'\njoint=2\namplitude_nm=0.4\norder_per_turn=202\nphase_rad=0.3",
        Some("kind='ripple'\njoint=2\namplitude_nm=0\norder_per_turn=202\nphase_rad=0.3"),
    ),
    ("kind='elasticity'\njoint=2\nstiffness_nm_rad=10000", None),
    ("kind='backlash'\njoint=3\ngap_rad=0.001", None),
    (
        "kind='torque_gain'\njoint=2\nerror_fraction=0.05",
        Some("kind='torque_gain'\njoint=2\nerror_fraction=0"),
    ),
    (
        "kind='current_offset'\njoint=3\noffset_nm=0.5",
        Some("kind='current_offset'\njoint=3\noffset_nm=0"),
    ),
    ("kind='saturation'\njoint=2\nlimit_nm=40", Some("kind='saturation'\njoint=2\nlimit_nm=1000")),
    (
        "kind='feed_forward'\njoint=6\nshare_less=0.5",
        Some("kind='feed_forward'\njoint=6\nshare_less=0"),
    ),
    (
        "kind='spring'\njoint=4\nstiffness_nm_rad=1\nrest_rad=0.2",
        Some("kind='spring'\njoint=4\nstiffness_nm_rad=0\nrest_rad=0.2"),
    ),
    (
        "kind='contact'\nstart_s=0.2\nend_s=0.6\npeak_nm=10",
        Some("kind='contact'\nstart_s=0.2\nend_s=0.6\npeak_nm=0"),
    ),
    (
        "kind='payload'\nmass_kg=1.5\ncom_x_m=0.01\ncom_y_m=0\ncom_z_m=0.05",
        Some("kind='payload'\nmass_kg=0\ncom_x_m=0.01\ncom_y_m=0\ncom_z_m=0.05"),
    ),
    ("kind='link_length'\njoint=3\nerror_m=0.002", Some("kind='link_length'\njoint=3\nerror_m=0")),
    ("kind='gravity'\ng_m_s2=9.78", Some("kind='gravity'\ng_m_s2=9.81")),
    (
        "kind='base_tilt'\ntilt_x_rad=0.01\ntilt_y_rad=-0.02",
        Some("kind='base_tilt'\ntilt_x_rad=0\ntilt_y_rad=0"),
    ),
    (
        "kind='encoder_offset'\njoint=2\noffset_rad=0.005",
        Some("kind='encoder_offset'\njoint=2\noffset_rad=0"),
    ),
    ("kind='time_skew'\ndelay_s=0.004", Some("kind='time_skew'\ndelay_s=0")),
    (
        "kind='velocity_lag'\njoint=1\ndelay_s=0.006",
        Some("kind='velocity_lag'\njoint=1\ndelay_s=0"),
    ),
    (
        "kind='clock_fault'\nlost_s=0.02\nevery_rows=50",
        Some("kind='clock_fault'\nlost_s=0\nevery_rows=50"),
    ),
    ("kind='quantisation'\nstep=0.1", None),
    ("kind='outliers'\nfraction=0.02", Some("kind='outliers'\nfraction=0")),
    ("kind='dropped_samples'\nfraction=0.05", Some("kind='dropped_samples'\nfraction=0")),
];

/// Sensors with noise on every channel.
fn sensors() -> Sensors {
    let config: SensorConfig =
        toml::from_str("torque_sd_nm = 0.3\nq_sd_rad = 1e-5\nqd_sd_rad_s = 1e-3").unwrap();
    Sensors::new(&config, &ur5(), PlantConfig::default().log_rate_hz).unwrap()
}

/// The log of trial 0.
fn log(tables: &[&str]) -> Measured {
    let plant = plant(tables).unwrap_or_else(|e| panic!("{tables:?}: {e}"));
    let recording = plant.run(&lively(), None).unwrap_or_else(|e| panic!("{tables:?}: {e}"));
    let streams = TrialStreams::new(1, b"faults", 0);
    let mut log = Measured::like(&recording);
    sensors().measure(&recording, &streams, &mut log);
    plant.spoil(&streams, &mut log);
    log
}

#[test]
fn without_effects_the_plant_is_the_plain_one_to_the_bit() {
    let plain = Plant::new(&ur5(), &PlantConfig::default()).unwrap().run(&lively(), None).unwrap();
    assert_eq!(run(&[], &lively()), plain);
}

#[test]
fn no_kind_of_effect_is_left_out() {
    let of = |tables: &[&str]| -> Vec<&'static str> {
        effects(tables).iter().map(Effect::kind).collect()
    };
    assert_eq!(of(&KINDS.map(|(effect, _)| effect)), Effect::KINDS);
    for (effect, nothing) in KINDS {
        assert!(nothing.is_none_or(|nothing| of(&[nothing]) == of(&[effect])), "{nothing:?}");
    }
}

#[test]
fn an_effect_of_no_size_changes_no_bit() {
    let clean = log(&[]);
    for (_, nothing) in KINDS {
        let Some(nothing) = nothing else { continue };
        assert!(log(&[nothing]) == clean, "{nothing}");
    }
}

#[test]
fn every_effect_shows_in_the_log_and_gives_the_same_bits_again() {
    let clean = log(&[]);
    for (effect, _) in KINDS {
        let spoilt = log(&[effect]);
        assert!(spoilt != clean, "{effect}");
        assert!(log(&[effect]) == spoilt, "{effect}");
    }
}

/// Torque delayed by one sample is the torque of the row before; the angles are untouched.
#[test]
fn skewed_torque_is_that_of_an_earlier_instant() {
    let clean = run(&[], &lively());
    let late = run(&["kind='time_skew'\ndelay_s=0.008"], &lively());
    assert_eq!(late.q_rad, clean.q_rad);
    for j in 0..6 {
        let rows = clean.torque_nm.samples();
        assert_eq!(late.torque_nm.joint(j)[1..], clean.torque_nm.joint(j)[..rows - 1]);
    }
    // Half a sample of the log is four control decisions: the torque between the rows is exact.
    let half = run(&["kind='time_skew'\njoint=2\ndelay_s=0.004"], &lively());
    let config = PlantConfig { log_rate_hz: 250.0, ..PlantConfig::default() };
    let dense = Plant::new(&ur5(), &config).unwrap().run(&lively(), None).unwrap();
    for k in 1..half.torque_nm.samples() {
        assert_eq!(half.torque_nm.joint(1)[k], dense.torque_nm.joint(1)[2 * k - 1]);
    }
    assert_eq!(half.torque_nm.joint(0), clean.torque_nm.joint(0));
}

/// A low-pass δ ẏ = q̇ − y, integrated: δ (y(T) − y(0)) + ∫ y dt = q(T) − q(0).
#[test]
fn a_lagging_velocity_loses_no_distance() {
    let delay_s = 0.01;
    let config = PlantConfig { log_rate_hz: 500.0, ..PlantConfig::default() };
    let effect = effects(&["kind='velocity_lag'\njoint=1\ndelay_s=0.01"]);
    let log = FaultyPlant::new(&ur5(), &effect, &config).unwrap().run(&lively(), None).unwrap();
    let (q, y) = (log.q_rad.joint(0), log.qd_rad_s.joint(0));
    let last = y.len() - 1;
    let area: f64 = y.windows(2).map(|w| 0.5 * (w[0] + w[1]) / 500.0).sum();
    let error = delay_s * (y[last] - y[0]) + area - (q[last] - q[0]);
    // The trapezoidal errors of q̇ and of y, each h²/12 times the change of acceleration (up to 2 · 20 rad/s²).
    assert!(error.abs() < 3e-5, "{error} rad over {} rad", q[last] - q[0]);
}

/// The clock stalls for three samples after every 50 rows: the rows after a stall are those of later instants.
#[test]
fn a_stalling_clock_hides_rows_and_keeps_counting() {
    let clean = run(&[], &lively());
    let log = run(&["kind='clock_fault'\nlost_s=0.024\nevery_rows=50"], &lively());
    let rows = log.time_s.len();
    assert_eq!(log.time_s, clean.time_s[..rows]);
    for k in 0..rows {
        let read = k + 3 * (k / 50);
        assert_eq!(log.q_rad.joint(1)[k], clean.q_rad.joint(1)[read]);
        assert_eq!(log.torque_nm.joint(1)[k], clean.torque_nm.joint(1)[read]);
    }
    assert!(rows < clean.time_s.len());
}

/// Shares of Bernoulli draws in 6 × 126 readings, 5 standard deviations (once in 2 million seeds).
#[test]
fn readings_go_wrong_as_often_as_asked() {
    let clean = log(&[]);
    let limits: Vec<f64> = ur5().joints.iter().map(|j| j.limits.torque_nm).collect();
    let spoilt = log(&["kind='outliers'\nfraction=0.1"]);
    let mut hit = 0;
    for (j, &limit) in limits.iter().enumerate() {
        for (a, b) in spoilt.torque_nm.joint(j).iter().zip(clean.torque_nm.joint(j)) {
            hit += usize::from(a != b);
            assert!(a == b || a.abs() <= limit);
        }
    }
    let count = 6.0 * clean.time_s.len() as f64;
    assert!((hit as f64 - 0.1 * count).abs() < 5.0 * (0.09 * count).sqrt(), "{hit} of {count}");

    let lossy = log(&["kind='dropped_samples'\nfraction=0.2"]);
    let lost = clean.time_s.len() - lossy.time_s.len();
    let rows = clean.time_s.len() as f64;
    assert!((lost as f64 - 0.2 * rows).abs() < 5.0 * (0.16 * rows).sqrt(), "{lost} of {rows}");
    for (k, t) in lossy.time_s.iter().enumerate() {
        let row = clean.time_s.iter().position(|s| s == t).unwrap();
        assert_eq!(lossy.torque_nm.joint(3)[k], clean.torque_nm.joint(3)[row]);
    }

    let stale = log(&["kind='dropped_samples'\njoint=2\nfraction=0.2\nrepeat=true"]);
    assert_eq!(stale.time_s, clean.time_s);
    assert_eq!(stale.q_rad.joint(0), clean.q_rad.joint(0));
    let repeated = stale.q_rad.joint(1).windows(2).filter(|w| w[0] == w[1]).count();
    assert!((repeated as f64 - 0.2 * rows).abs() < 5.0 * (0.16 * rows).sqrt(), "{repeated}");
}

#[test]
fn a_coarse_reading_has_whole_steps() {
    let coarse = log(&["kind='quantisation'\njoint=3\nstep=0.001\nchannel='position'"]);
    let clean = log(&[]);
    for (a, b) in coarse.q_rad.joint(2).iter().zip(clean.q_rad.joint(2)) {
        assert!((a / 0.001 - (a / 0.001).round()).abs() < 1e-9 && (a - b).abs() <= 0.5001e-3);
    }
    assert_eq!(coarse.q_rad.joint(1), clean.q_rad.joint(1));
}

/// Any two effects run together, tested on short runs; the log has only finite numbers.
#[test]
fn any_two_effects_combine() {
    let short = Start { motion: lively().motion, duration_s: 0.04 };
    for (i, (first, _)) in KINDS.iter().enumerate() {
        for (second, _) in &KINDS[..i] {
            let plant = plant(&[first, second]).unwrap_or_else(|e| panic!("{first} {second}: {e}"));
            let log = plant.run(&short, None).unwrap_or_else(|e| panic!("{first} {second}: {e}"));
            let finite = (0..6).all(|j| log.torque_nm.joint(j).iter().all(|t| t.is_finite()));
            assert!(finite, "{first} {second}");
        }
    }
}

/// With noise in the control loop the readings keep their errors, whatever else changes with the timing.
#[test]
fn effects_live_with_a_controller_that_reads_the_sensors() {
    let streams = TrialStreams::new(1, b"faults", 0);
    let read = |tables: &[&str]| {
        plant(tables).unwrap().run(&lively(), Some(sensors().encoders(&streams))).unwrap()
    };
    let (clean, skewed) = (read(&[]), read(&["kind='time_skew'\ndelay_s=0.004"]));
    let elastic = read(&["kind='elasticity'\njoint=2\nstiffness_nm_rad=10000"]);
    assert_eq!(skewed.readings, clean.readings);
    assert!(skewed.torque_nm != clean.torque_nm && elastic.readings != clean.readings);
}

#[test]
fn nonsense_is_refused_with_its_place_and_key() {
    for (table, bad_key) in [
        ("kind='stribeck'\njoint=7\nextra_nm=0.5\nvs_rad_s=0.1", "joint"),
        ("kind='stribeck'\njoint=0\nextra_nm=0.5\nvs_rad_s=0.1", "joint"),
        ("kind='stribeck'\njoint=1\nextra_nm=0.5\nvs_rad_s=0", "vs_rad_s"),
        ("kind='load_friction'\njoint=1\nmu=0.9", "mu"),
        ("kind='contact'\nstart_s=2\nend_s=1\npeak_nm=3", "end_s"),
        ("kind='link_length'\njoint=2\nerror_m=0.001", "joint"),
        ("kind='dropped_samples'\njoint=2\nfraction=0.1", "joint"),
        ("kind='clock_fault'\nlost_s=0.1\nevery_rows=0", "every_rows"),
        ("kind='payload'\nmass_kg=nan\ncom_x_m=0\ncom_y_m=0\ncom_z_m=0", "mass_kg"),
    ] {
        match plant(&["kind='gravity'\ng_m_s2=9.8", table]) {
            Err(PlantError::Effect { number: 2, key, .. }) => assert_eq!(key, bad_key, "{table}"),
            other => panic!("{table}: {:?}", other.err()),
        }
    }
    let mut arm = Arm::built_in("ur5").unwrap();
    arm.joints[1].limits.torque_nm = f64::INFINITY;
    for (table, is_refused) in [
        ("kind='outliers'\nfraction=0.1", true),
        ("kind='outliers'\njoint=1\nfraction=0.1", false),
        ("kind='load_friction'\njoint=2\nmu=0.1", true),
    ] {
        let found = FaultyPlant::new(&arm, &effects(&[table]), &PlantConfig::default());
        assert_eq!(found.is_err(), is_refused, "{table}");
    }
    // The force on a flange follows from the reach of the arm.
    arm.joints.iter_mut().for_each(|joint| joint.placement.translation_m.fill(0.0));
    for (table, is_refused) in [
        ("kind='contact'\nstart_s=0\nend_s=1\npeak_nm=3", true),
        ("kind='contact'\njoint=2\nstart_s=0\nend_s=1\npeak_nm=3", false),
    ] {
        let found = FaultyPlant::new(&arm, &effects(&[table]), &PlantConfig::default());
        assert_eq!(found.is_err(), is_refused, "{table}");
    }
    let driving = plant(&["kind='stribeck'\njoint=1\nextra_nm=-20\nvs_rad_s=1"]);
    assert!(matches!(driving, Err(PlantError::FrictionDrives { joint: 1, .. })));
    let stiff = plant(&["kind='elasticity'\njoint=6\nstiffness_nm_rad=1e9"]).unwrap();
    assert!(matches!(stiff.run(&lively(), None), Err(PlantError::StepTooLong { .. })));
    for unknown in ["kind='stribek'\njoint=1", "kind='gravity'\ng_m_s2=9.8\njoint=1"] {
        let text = format!("effect = [{{ {} }}]", unknown.replace('\n', ", "));
        #[derive(Debug, serde::Deserialize)]
        struct File {
            #[allow(dead_code)]
            effect: Vec<Effect>,
        }
        assert!(toml::from_str::<File>(&text).is_err(), "{unknown}");
    }
}

/// `sims/effects.toml` shows every kind of effect with every key.
#[test]
fn the_list_of_effects_is_complete() {
    let file = std::path::Path::new("sims/effects.toml");
    let scenario = armid::montecarlo::Scenario::load(Some(file)).unwrap();
    let mut shown: Vec<&str> = scenario.effects.iter().map(Effect::kind).collect();
    let mut all = Effect::KINDS.to_vec();
    shown.sort_unstable();
    all.sort_unstable();
    assert_eq!(shown, all);
    let text = std::fs::read_to_string(file).unwrap();
    let tables: Vec<&str> = text.split("[[effect]]").skip(1).collect();
    for (effect, table) in scenario.effects.iter().zip(tables) {
        for key in effect.parameters().keys() {
            assert!(table.contains(&format!("\n{key} = ")), "{key} of {}", effect.kind());
        }
    }
}
