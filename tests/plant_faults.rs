//! Hidden effects against the physics they must obey.

use armid::excitation::{FourierSeries, Reference};
use armid::plant::faults::{Effect, FaultyPlant};
use armid::plant::{Measured, Plant, PlantConfig, PlantError, Recording, SensorConfig, Sensors};
use armid::random::TrialStreams;
use armid::robot::Arm;

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

/// The `[[effect]]` tables of a scenario.
fn effects(tables: &[&str]) -> Vec<Effect> {
    #[derive(serde::Deserialize)]
    struct File {
        #[serde(default)]
        effect: Vec<Effect>,
    }
    let text: String = tables.iter().map(|t| format!("[[effect]]\n{t}\n")).collect();
    toml::from_str::<File>(&text).unwrap_or_else(|e| panic!("{text}: {e}")).effect
}

fn plant(tables: &[&str]) -> Result<FaultyPlant, PlantError> {
    FaultyPlant::new(&ur5(), &effects(tables), &PlantConfig::default())
}

fn run(tables: &[&str], reference: &dyn Reference) -> Recording {
    plant(tables).unwrap().run(reference, None).unwrap()
}

/// Every kind, of a size that a log shows, and, where there is such a thing, of no size at all.
const KINDS: [(&str, Option<&str>); 27] = [
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

/// Noise on every channel.
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
