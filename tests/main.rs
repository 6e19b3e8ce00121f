//! All integration tests in one program, which is compiled and linked once and keeps every core busy to its end.
//! `cargo test val_` runs the tests against independent references, `regress_` those against pinned results, `blind_`
//! hide and find.

mod blind;
mod cli;
mod damage;
mod golden;
mod hidden;
mod real_logs;
mod simulated;

mod blind_benchmark;
mod blind_changes;
mod blind_families;
mod blind_friction;
mod blind_moves;
mod blind_records;
mod blind_single_runs;
mod cli_diagnose;
mod cli_excite;
mod cli_formats;
mod cli_identify;
mod cli_montecarlo;
mod cli_physical;
mod cli_predict;
mod cli_refusals;
mod cli_study;
mod cli_urdf;
mod cycles_between_samples;
mod damaged_logs;
mod detection_limits;
mod diagnose_periodic;
mod drifting_friction;
mod dynamics_identities;
mod effect_size;
mod excite_design;
mod held_at_rest;
mod impossible_inertia;
mod late_bursts;
mod log_defects;
mod log_write;
mod misread_logs;
mod other_arms;
mod plant_faults;
mod plant_runs;
mod plant_sensors;
mod regress_chain;
mod replay;
mod several_logs;
mod two_recordings;
mod val_base;
mod val_calibration;
mod val_covariance;
mod val_dynamics;
mod val_export;
mod val_faults;
mod val_log_fuzz;
mod val_log_real;
mod val_mjcf;
mod val_paper_base;
mod val_physical;
mod val_plant;
mod val_real_arm;
mod val_replay;
mod val_signal;
mod val_ur10e;
mod val_urdf;

/// A file that is not listed above would never be compiled.
#[test]
fn every_file_is_a_part_of_this_program() {
    let parts = include_str!("main.rs");
    for file in std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/tests")).unwrap() {
        let path = file.unwrap().path();
        let name = path.file_stem().unwrap().to_str().unwrap();
        let is_source = path.is_dir() || path.extension().is_some_and(|end| end == "rs");
        assert!(
            !is_source || name == "main" || parts.contains(&format!("mod {name};\n")),
            "{name}"
        );
    }
}
