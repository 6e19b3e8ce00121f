//! Hide and find effects that any fit would absorb: against a simulation without the effect, or against a second log.
//! Also contacts, which no fit absorbs. The plant produces everything that is hidden.

use armid::diagnose::{Cause, Diagnosis, Estimate, Kind, Nominal, Validation, Verdict};
use armid::identify::{Identifier, Measurement};

use crate::simulated::{NOISE, Run, assert_holds, scenario};

/// `periods` of the identification motion with the effects in `toml`.
fn run(seed: u64, periods: usize, toml: &str) -> Run {
    Run::new(scenario(("changes", seed), ("ur5_identification", periods), NOISE, toml))
}

/// Diagnoses the log against the simulation of the nominal arm.
fn against_nominal(run: &Run) -> Diagnosis {
    let nominal = run.set.values(&run.model.standard_parameters());
    let log = run.log.measurement("changes");
    let finding = run.diagnoser().diagnose(&log, &[], Some(Nominal::certain(&nominal))).unwrap();
    println!("{:#?}", finding.diagnosis.sentences);
    for cause in &finding.diagnosis.causes {
        println!("{} {:?} {:.1} {:?}", cause.kind, cause.joint, cause.strength, cause.parameters);
    }
    finding.diagnosis
}

fn strongest(d: &Diagnosis) -> &Cause {
    d.causes.iter().max_by(|a, b| a.strength.total_cmp(&b.strength)).expect("something is named")
}

#[test]
fn a_payload_is_named_against_the_simulation() {
    let toml = "[[effect]]\nkind = \"payload\"\nmass_kg = 1.5\ncom_x_m = 0.02\ncom_y_m = -0.03\n\
                com_z_m = 0.06\n";
    let d = against_nominal(&run(11, 4, toml));
    let cause = strongest(&d);
    assert_eq!((cause.kind.name(), cause.joint), ("payload", None));
    assert_holds(cause, "mass_kg", 1.5);
    assert_holds(cause, "com_x_m", 0.02);
    assert_holds(cause, "com_y_m", -0.03);
    assert_holds(cause, "com_z_m", 0.06);
    let moved = d.moved_parameters.iter().filter(|m| m.z.abs() > 5.0).count();
    assert!(moved >= 4, "a body moves masses and moments: {moved} moved");
}

#[test]
fn a_tilted_base_is_named_against_the_simulation() {
    let toml = "[[effect]]\nkind = \"base_tilt\"\ntilt_x_rad = 0.02\ntilt_y_rad = -0.01\n";
    let d = against_nominal(&run(12, 4, toml));
    let cause = strongest(&d);
    assert_eq!((cause.kind.name(), cause.joint), ("base_tilt", None));
    assert_holds(cause, "tilt_x_rad", 0.02);
    assert_holds(cause, "tilt_y_rad", -0.01);
}

#[test]
fn a_wrong_gain_is_named_at_its_joint_against_the_simulation() {
    let toml = "[[effect]]\nkind = \"torque_gain\"\njoint = 3\nerror_fraction = 0.05\n";
    let d = against_nominal(&run(13, 4, toml));
    let cause = strongest(&d);
    assert_eq!((cause.kind.name(), cause.joint), ("torque_gain", Some(3)));
    assert_holds(cause, "error_fraction", 0.05);
}

/// A zero that is off is felt the more, the more the flange carries: its size is that in the loaded arm, and nothing is
/// left for other zeros.
#[test]
fn a_lost_zero_is_sized_in_the_loaded_arm() {
    let toml = "[[effect]]\nkind = \"payload\"\nmass_kg = 1.5\ncom_x_m = 0.02\ncom_y_m = -0.03\n\
                com_z_m = 0.06\n[[effect]]\nkind = \"encoder_offset\"\njoint = 2\noffset_rad = 0.02\n";
    let d = against_nominal(&run(15, 4, toml));
    let mut named: Vec<_> = d.causes.iter().map(|c| (c.kind.name(), c.joint)).collect();
    named.sort_unstable();
    assert_eq!(named, [("encoder_offset", Some(2)), ("payload", None)]);
    for cause in &d.causes {
        match cause.kind {
            Kind::Payload => assert_holds(cause, "mass_kg", 1.5),
            _ => assert_holds(cause, "offset_rad", 0.02),
        }
    }
}

#[test]
fn nothing_is_named_against_the_simulation_that_made_the_log() {
    let d = against_nominal(&run(14, 4, ""));
    assert!(d.causes.is_empty());
    // Among 52 parameters, the largest |t| exceeds 5 with a probability of at most 10⁻³.
    assert!(d.moved_parameters.iter().all(|m| m.z.abs() < 5.0));
    assert!(!says_that_contacts_are_not_looked_for(&d), "{:?}", d.warnings);
}

/// The simulation is identified from another clean log, along another motion with twice the noise, twice the rate and
/// other drives. Its errors are described by its covariance, for all combinations of parameters. When it is taken as
/// exact, changes are named in these logs.
#[test]
fn what_an_identified_simulation_does_not_know_is_no_change() {
    let loud =
        "torque_sd_nm = [2.0, 2.0, 1.4, 0.3, 0.3, 0.3]\nq_sd_rad = 4e-5\nqd_sd_rad_s = 2e-3\n";
    let mut as_if_exact = 0;
    for seed in [41, 42] {
        let plant = "[plant]\nlog_rate_hz = 250.0\nfriction_feedforward = 0.5\n";
        let before = Run::new(scenario(("before", seed), ("ur5_validation", 6), loud, plant));
        let mut identifier = Identifier::new(&before.model, &before.set, before.options.clone());
        let identified = identifier.identify(&before.log.measurement("before")).unwrap();
        let simulation = Nominal {
            theta: &identified.fit.theta,
            covariance: Some(&identified.covariance.matrix),
            freedom: identified.covariance.degrees_of_freedom,
            doubt: None,
        };
        let against = |run: &Run, simulation: Nominal| {
            let log = run.log.measurement("after");
            run.diagnoser().diagnose(&log, &[], Some(simulation)).unwrap().diagnosis
        };
        let clean = run(seed, 6, "");
        let d = against(&clean, simulation);
        assert!(d.causes.is_empty(), "{:?}", d.sentences);
        // 58 parameters in two logs: noise moves one of them by 5 σ in one of 15 000 such tests.
        assert!(d.moved_parameters.iter().all(|moved| moved.z.abs() < 5.0));
        let together = d.moved_together.unwrap();
        // One in 10⁴ such logs has a smaller p-value.
        assert!(together.p_value > 1e-4, "{together:?}");
        as_if_exact += against(&clean, Nominal::certain(simulation.theta)).causes.len();

        let body = "[[effect]]\nkind = \"payload\"\nmass_kg = 0.5\ncom_x_m = 0.0\ncom_y_m = 0.02\n\
                    com_z_m = 0.05\n";
        let d = against(&run(seed, 6, body), simulation);
        let named: Vec<_> = d.causes.iter().map(|c| c.kind).collect();
        assert_eq!(named, [Kind::Payload], "{:?}", d.sentences);
        assert_holds(&d.causes[0], "mass_kg", 0.5);
        assert!(d.moved_together.unwrap().p_value < 1e-9);
    }
    assert!(as_if_exact > 0, "a test that cannot fail");
}

/// The parameters cannot follow all of a change of gravity, which is named by what they leave, and against a simulation.
#[test]
fn another_gravity_is_nothing_else() {
    let run = run(22, 4, "[[effect]]\nkind = \"gravity\"\ng_m_s2 = 9.2\n");
    let log = run.log.measurement("changes");
    let alone = run.diagnoser().diagnose(&log, &[], None).unwrap().diagnosis;
    for d in [alone, against_nominal(&run)] {
        let named: Vec<_> = d.causes.iter().map(|cause| cause.kind).collect();
        assert_eq!(named, [Kind::Gravity], "{:?}", d.sentences);
        assert_holds(&d.causes[0], "g_m_s2", 9.2);
    }
}

/// The part of an effect that a fit would absorb is not a change of the arm: load friction contains the whole curve of
/// Coulomb friction.
#[test]
fn effects_beside_a_simulation_are_no_changes() {
    let friction = "[[effect]]\nkind = \"load_friction\"\njoint = 2\nmu = 0.06\n\
                    [[effect]]\nkind = \"stribeck\"\njoint = 4\nextra_nm = 0.4\nvs_rad_s = 0.08\n";
    let payload = "[[effect]]\nkind = \"payload\"\nmass_kg = 1.0\ncom_x_m = 0.02\ncom_y_m = 0.0\ncom_z_m = 0.06\n";
    let named = |d: &Diagnosis| {
        let mut named: Vec<_> = d.causes.iter().map(|c| (c.kind, c.joint)).collect();
        named.sort_unstable();
        named
    };
    let effects = [(Kind::Stribeck, Some(4)), (Kind::LoadFriction, Some(2))];
    let d = against_nominal(&run(31, 4, friction));
    assert_eq!(named(&d), effects);
    // As above: the effects have not moved any parameter.
    assert!(d.moved_parameters.iter().all(|m| m.z.abs() < 5.0), "{:?}", d.moved_parameters);
    let d = against_nominal(&run(32, 4, &(friction.to_owned() + payload)));
    assert_eq!(named(&d), [effects[0], effects[1], (Kind::Payload, None)]);
    let body = d.causes.iter().find(|c| c.kind == Kind::Payload).unwrap();
    assert_holds(body, "mass_kg", 1.0);
}

fn says_that_contacts_are_not_looked_for(d: &Diagnosis) -> bool {
    d.warnings.iter().any(|warning| warning.starts_with("contacts are not looked for"))
}

/// If two periods differ, neither can be identified as the one that was touched.
#[test]
fn of_two_periods_contacts_are_not_looked_for() {
    let mut run = run(19, 3, "");
    // The third period is cut off.
    let rows = 0..3200;
    run.log.time_s.truncate(rows.end);
    for signals in [&mut run.log.q_rad, &mut run.log.qd_rad_s, &mut run.log.torque_nm] {
        *signals = signals.slice(rows.clone());
    }
    let d = against_nominal(&run);
    assert!(says_that_contacts_are_not_looked_for(&d), "{:?}", d.warnings);
}

/// A body on the flange is fully absorbed by the parameters of any fit: no effect is added to the model that could
/// improve the prediction of another log.
#[test]
fn what_only_moves_the_parameters_gains_nothing() {
    let toml = "[[effect]]\nkind = \"payload\"\nmass_kg = 0.5\ncom_x_m = 0.0\ncom_y_m = 0.02\n\
                com_z_m = 0.05\n";
    let (run, other) = (run(20, 4, toml), run(21, 3, toml));
    let nominal = run.set.values(&run.model.standard_parameters());
    let [log, other] = [&run, &other].map(|run| run.log.measurement("changes"));
    let held_out = [Validation { measurement: other, manufacturer_nm: None }];
    let finding =
        run.diagnoser().diagnose(&log, &held_out, Some(Nominal::certain(&nominal))).unwrap();
    let d = &finding.diagnosis;
    assert!(finding.extension.effects.is_empty() && !d.causes.is_empty(), "{:?}", d.sentences);
    assert!(!d.sentences.iter().any(|s| s.contains("with what is named")), "{:?}", d.sentences);
}

#[test]
fn a_body_between_two_logs_is_weighed_and_scales_the_gains() {
    let body = "[[effect]]\nkind = \"payload\"\nmass_kg = 2.0\ncom_x_m = 0.01\ncom_y_m = 0.04\n\
                com_z_m = 0.05\n";
    let runs = [(15, ""), (16, body), (17, "")].map(|(seed, body)| run(seed, 3, body));
    let [bare, loaded, other] = [0, 1, 2].map(|k| runs[k].log.measurement("changes"));
    let mut diagnoser = runs[0].diagnoser();
    let finding = diagnoser.diagnose(&bare, &[], None).unwrap();
    let mut against =
        |log: &Measurement| diagnoser.payload(&finding, &bare, log, Some(2.0)).unwrap();
    let weighed = against(&loaded);
    println!("{weighed:#?}");
    let cause = weighed.cause().expect("a body is named");
    assert_holds(&cause, "mass_kg", 2.0);
    assert_holds(&cause, "com_x_m", 0.01);
    assert_holds(&cause, "com_y_m", 0.04);
    assert_holds(&cause, "com_z_m", 0.05);
    let scale = weighed.gain_scale.as_ref().unwrap();
    // The interval is used as in `assert_holds`.
    let [low, high] = scale.ci95;
    assert!((scale.value - 1.0).abs() < high - low && high - low < 0.1, "{scale:?}");
    let none = against(&other);
    assert!(!none.is_named && none.cause().is_none(), "{none:?}");
    // A push during the log with the body adds no weight: each of the two estimates is within its own 95 %.
    let push =
        "[[effect]]\nkind = \"contact\"\njoint = 2\nstart_s = 24.0\nend_s = 24.5\npeak_nm = 25.0\n";
    let pushed = run(16, 4, &format!("{body}{push}"));
    let touched = against(&pushed.log.measurement("changes"));
    println!("{touched:#?}");
    assert!(touched.was_touched && !weighed.was_touched && !none.was_touched);
    let half_kg = |e: &Estimate| 0.5 * (e.ci95[1] - e.ci95[0]);
    let (with, without) = (&touched.mass_kg, &weighed.mass_kg);
    let apart_kg = (with.value - without.value).abs();
    assert!(apart_kg < half_kg(without), "{with:?} {without:?}");
    assert!(half_kg(with) < 1.2 * half_kg(without), "{with:?} {without:?}");

    // With the logs swapped, the body has a negative mass, and the model fits only the first log.
    let bare_run = [Validation { measurement: bare, manufacturer_nm: None }];
    let of_loaded = diagnoser.diagnose(&loaded, &bare_run, None).unwrap();
    let swapped = diagnoser.payload(&of_loaded, &loaded, &bare, None).unwrap();
    assert!(swapped.mass_kg.value < 0.0 && swapped.cause().is_none(), "{swapped:?}");
    assert!(swapped.sentences()[0].contains("swapped"), "{:?}", swapped.sentences());
    let mut told = of_loaded.diagnosis;
    let of_the_body = swapped.sentences();
    told.add_payload(swapped);
    let said = &told.sentences;
    assert!(said.iter().any(|s| s.contains("does not carry over")), "{said:?}");
    // A flange that carries less is no good log, whatever the first log says.
    assert_ne!(told.verdict, Verdict::NothingFound, "{said:?}");
    assert!(!said.iter().any(|s| s.starts_with("Nothing found")), "{said:?}");
    // The body that is missing is told first.
    let first = usize::from(told.doubt.is_some());
    assert_eq!(said[first..first + of_the_body.len()], of_the_body);
}

/// A gain that is named along the first log is a part of what the known mass says of the drives: joint 4 reads 10 % too
/// low, so that its gain is to be multiplied by 1/0.9, and the others by one.
#[test]
fn a_known_mass_tells_the_gain_that_is_off() {
    let gain = "[[effect]]\nkind = \"torque_gain\"\njoint = 4\nerror_fraction = -0.1\n";
    let body = "[[effect]]\nkind = \"payload\"\nmass_kg = 2.0\ncom_x_m = 0.01\ncom_y_m = 0.04\n\
                com_z_m = 0.05\n";
    let [bare, loaded] = [(22, gain.to_owned()), (23, format!("{gain}{body}"))]
        .map(|(seed, toml)| run(seed, 4, &toml));
    let [log, other] = [&bare, &loaded].map(|run| run.log.measurement("changes"));
    let mut diagnoser = bare.diagnoser();
    let finding = diagnoser.diagnose(&log, &[], None).unwrap();
    let named: Vec<_> = finding.diagnosis.causes.iter().map(|c| (c.kind, c.joint)).collect();
    assert_eq!(named, [(Kind::TorqueGain, Some(4))]);
    let weighed = diagnoser.payload(&finding, &log, &other, Some(2.0)).unwrap();
    let scales = weighed.joint_gain_scales.as_ref().unwrap();
    println!("{scales:#?}");
    // Twice the 95 % interval, as in `assert_holds`. Joints 2 to 4 carry the body against gravity.
    for (scale, truth) in scales[1..4].iter().zip([1.0, 1.0, 1.0 / 0.9]) {
        let half = 0.5 * (scale.ci95[1] - scale.ci95[0]);
        assert!((scale.value - truth).abs() < 2.0 * half && half < 0.05, "{truth}: {scale:?}");
    }
}

#[test]
fn a_push_is_found_when_and_where_it_was() {
    // 20 s to 20.5 s: in the third period of a 10 s motion that begins after its run-in.
    let toml =
        "[[effect]]\nkind = \"contact\"\njoint = 2\nstart_s = 24.0\nend_s = 24.5\npeak_nm = 25.0\n";
    let d = against_nominal(&run(18, 4, toml));
    let touched: Vec<&Cause> = d.causes.iter().filter(|c| c.kind.name() == "contact").collect();
    assert_eq!(touched.len(), 1);
    // A push that grows as sin² reaches a quarter of its height after a sixth of its length. The diagnosis reports when
    // the push is felt, to a quarter of its length beyond the interval.
    for (name, truth) in [("start_s", 24.0), ("end_s", 24.5)] {
        let e = &touched[0].parameters[name];
        let off_s = (e.ci95[0] - truth).max(truth - e.ci95[1]).max(0.0);
        assert!(off_s < 0.125 && e.ci95[1] - e.ci95[0] < 0.125, "{name}: {e:?}");
    }
    assert!(touched[0].in_words.contains("joint 2"), "{}", touched[0].in_words);
    // A push against the motion asks the drive for more torque. The low-pass and the controller's response blur the
    // peak, so that the reading is only within a third of it.
    let peak = touched[0].parameters["peak_nm"].value;
    assert!((peak.abs() - 25.0).abs() < 8.5, "{peak}");
}
