//! All integration tests in one program, which is compiled and linked once and keeps every core busy to its end: `cargo test val_`
//! runs those against something independent, `regress_` those against ourselves, `blind_` hide and find.

mod golden;
mod hidden;
mod simulated;

mod blind_benchmark;
mod blind_changes;
mod blind_families;
mod blind_records;
mod cli_diagnose;
mod cli_excite;
mod cli_formats;
mod cli_identify;
mod cli_physical;
mod cli_study;
mod detection_limits;
mod diagnose_periodic;
mod dynamics_identities;
mod effect_size;
mod excite_design;
mod log_defects;
mod log_write;
mod plant_faults;
mod plant_runs;
mod plant_sensors;
mod regress_chain;
mod replay;
mod several_logs;
mod val_base;
mod val_calibration;
mod val_covariance;
mod val_dynamics;
mod val_export;
mod val_faults;
mod val_log_fuzz;
mod val_log_real;
mod val_paper_base;
mod val_physical;
mod val_plant;
mod val_real_arm;
mod val_replay;
mod val_signal;
mod val_ur10e;
mod val_urdf;
