//! The design of an excitation as a whole: repeatable, feasible, and better than a random motion.

use std::sync::atomic::AtomicBool;
use std::time::Instant;

use armid::base::{BaseSet, Parameterisation};
use armid::dynamics::Model;
use armid::excitation::design::{
    Budget, Criterion, Design, DesignError, Experiment, Prediction, Specification, Variables,
    design,
};
use armid::excitation::{FourierSeries, Requirements, check};
use armid::robot::Arm;
use faer::Mat;

use crate::simulated::SIGMA_NM;

fn specification(criterion: Criterion) -> Specification {
    Specification {
        criterion,
        variables: Variables {
            order: 4,
            period_s: 10.0,
            period_range_s: None,
            fixed_offsets_rad: vec![None; 6],
            rest_start: false,
        },
        requirements: Requirements::default(),
        experiment: Experiment { data_s: 80.0, rate_hz: 125.0, torque_noise_nm: SIGMA_NM.to_vec() },
        prior: None,
        starts: 3,
        finalists: 2,
        seed: 5,
    }
}

fn ur5() -> (Arm, BaseSet) {
    let arm = Arm::built_in("ur5").unwrap();
    let base = BaseSet::find(&arm, Parameterisation::full(6, false)).unwrap();
    (arm, base)
}

fn run(spec: &Specification, threads: usize) -> Result<Design, DesignError> {
    let (arm, base) = ur5();
    let stop = AtomicBool::new(false);
    let budget = Budget { deadline: None, stop: &stop };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| design(&arm, &base, spec, &budget, &|_| {}))
}

/// The bits are the same on one and on three threads.
#[test]
fn a_design_depends_on_its_seed_and_not_on_the_threads() {
    let spec = specification(Criterion::D);
    let (one, three) = (run(&spec, 1).unwrap(), run(&spec, 3).unwrap());
    assert_eq!(one.excitation, three.excitation);
    assert_eq!(one.value.to_bits(), three.value.to_bits());
    assert!(!one.cut_short);
    let other = run(&Specification { seed: 6, ..spec }, 2).unwrap();
    assert_ne!(one.excitation, other.excitation);
}

/// A design keeps every limit on a grid three times finer than the one it was accepted on, starts and ends its period
/// at rest if required, and keeps its fixed offsets.
#[test]
fn a_design_keeps_its_limits_and_its_form() {
    let (arm, base) = ur5();
    let mut spec = specification(Criterion::Cond);
    spec.variables.rest_start = true;
    spec.variables.fixed_offsets_rad[1] = Some(-1.5);
    let found = run(&spec, 2).unwrap();
    // Between two samples of the accepting grid, 1 ms apart, a speed can grow by at most 10 rad/s² · 0.5 ms, and a
    // distance can shrink by about 1e-6 m; the required clearance is therefore slightly lower here.
    let finer =
        Requirements { check_rate_hz: 3000.0, clearance_m: 0.02 - 1e-5, ..spec.requirements };
    let margins = check(&arm, &finer, &found.excitation).unwrap();
    let worst = margins.worst();
    assert!(worst.free > -1e-4, "{} {}", worst.limit, worst.in_words());
    let series = found.excitation.series();
    // In its own criterion, even this small and more restricted search beats the built-in random motion.
    let random = FourierSeries::built_in("ur5_identification").unwrap();
    let of_random = Prediction::of(&Model::new(&arm), &base, &spec.experiment, &random, None);
    let random_condition = of_random.unwrap().condition;
    assert!(
        found.prediction.condition < random_condition,
        "{} against {random_condition}",
        found.prediction.condition
    );
    assert!((series.q0_rad[1] + 1.5).abs() < 1e-12);
    for (a, b) in series.a_rad_s.iter().zip(&series.b_rad_s) {
        assert!(a.iter().sum::<f64>().abs() < 1e-12);
        let ramp = b.iter().enumerate().map(|(l, b)| (l + 1) as f64 * b);
        assert!(ramp.sum::<f64>().abs() < 1e-11);
    }
}

/// Long periods are limited by the ranges of the joints. Random motions are no larger than these, and what is kept free
/// for the angles between the samples of such a period, or of one in the range, leaves enough of the elbow's ±π rad.
#[test]
fn long_periods_are_designed() {
    for (period_s, period_range_s) in
        [(200.0, None), (60.0, Some([10.0, 120.0])), (10.0, Some([5.0, 200.0]))]
    {
        let mut spec = specification(Criterion::D);
        spec.variables.period_s = period_s;
        spec.variables.period_range_s = period_range_s;
        spec.requirements.check_rate_hz = 100.0;
        let found = run(&spec, 2).unwrap();
        assert_eq!(found.feasible_starts, found.starts, "{period_s} s, {period_range_s:?}");
        assert!(found.margins.feasible());
    }
}

/// A free period is optimised, and parameters that are already known are not measured again.
#[test]
fn a_free_period_and_a_prior_are_used() {
    let mut spec = specification(Criterion::A);
    spec.variables.period_range_s = Some([6.0, 16.0]);
    let plain = run(&spec, 2).unwrap();
    let period_s = plain.excitation.series().period_s;
    assert!((6.0..=16.0).contains(&period_s) && (period_s - 10.0).abs() > 1e-3);

    // The prior knows everything except friction, ten times better than the first design does. The next design then
    // concentrates on friction: its own data determine friction better than those of the first design.
    let (_, base) = ur5();
    let friction: Vec<usize> =
        (0..base.rank()).filter(|&k| base.name(k).starts_with('r')).collect();
    let known = |k: usize| match friction.contains(&k) {
        true => 0.0,
        false => (10.0 / plain.prediction.sigma[k]).powi(2),
    };
    let rank = base.rank();
    let prior = Mat::from_fn(rank, rank, |i, k| if i == k { known(k) } else { 0.0 });
    let next = run(&Specification { prior: Some(prior), ..spec }, 2).unwrap();
    let mean = |d: &Design| {
        friction.iter().map(|&k| d.prediction.sigma[k].ln()).sum::<f64>() / friction.len() as f64
    };
    assert!(mean(&next) < mean(&plain) - 0.1, "{} {}", mean(&next), mean(&plain));
}

#[test]
fn a_design_that_is_stopped_at_once_is_still_feasible() {
    let (arm, base) = ur5();
    let spec = specification(Criterion::D);
    let stop = AtomicBool::new(true);
    let budget = Budget { deadline: Some(Instant::now()), stop: &stop };
    let found = design(&arm, &base, &spec, &budget, &|_| {}).unwrap();
    assert!(found.cut_short);
    assert!(check(&arm, &spec.requirements, &found.excitation).unwrap().feasible());
}

#[test]
fn specifications_that_make_no_sense_are_refused_with_the_number() {
    let message = |change: fn(&mut Specification)| {
        let mut spec = specification(Criterion::D);
        change(&mut spec);
        run(&spec, 1).unwrap_err().to_string()
    };
    assert!(message(|s| s.variables.order = 0).contains("order"));
    assert!(message(|s| s.variables.period_s = -1.0).contains("-1"));
    assert!(message(|s| s.variables.period_range_s = Some([12.0, 20.0])).contains("12"));
    assert!(message(|s| s.variables.fixed_offsets_rad[2] = Some(3.5)).contains("joint 3"));
    assert!(message(|s| s.variables.fixed_offsets_rad = vec![None]).contains("6 joints"));
    assert!(message(|s| s.experiment.torque_noise_nm[4] = 0.0).contains("joint 5"));
    assert!(message(|s| s.requirements.torque_share = 1.5).contains("1.5"));
    assert!(message(|s| s.starts = 0).contains("starts"));
    assert!(message(|s| s.experiment.data_s = 1e9).contains("1000000000 must be at most"));
    let unused = |s: &mut Specification| {
        s.criterion = Criterion::Cond;
        s.prior = Some(Mat::identity(52, 52));
    };
    assert!(message(unused).contains("prior"));
    // An arm that lies on the floor has no room to move.
    let flat = |s: &mut Specification| {
        s.variables.fixed_offsets_rad = [0.0, 0.5, 0.0, 0.0, 0.0, 0.0].map(Some).to_vec();
    };
    assert!(message(flat).contains("floor"));
    // No pose keeps the arm a metre from itself.
    assert!(message(|s| s.requirements.clearance_m = 1.0).contains("poses all over the range"));
}

/// The prediction holds for the motion that is written, which is at least as long as the requested data.
#[test]
fn the_prediction_is_of_the_periods_that_are_played() {
    let (arm, base) = ur5();
    let mut spec = specification(Criterion::D);
    spec.experiment.data_s = 14.0;
    let found = run(&spec, 2).unwrap();
    assert_eq!(found.excitation.periods(), 2);
    assert_eq!(found.experiment.data_s, 20.0);
    let series = found.excitation.series();
    let expected =
        Prediction::of(&Model::new(&arm), &base, &found.experiment, series, None).unwrap();
    assert_eq!(found.prediction, expected);
}

/// The prediction follows the textbook formula: σ² on the diagonal of the inverse information, which falls with the
/// length of the data and grows with the square of the noise.
#[test]
fn predicted_sigma_scales_with_noise_and_data() {
    let (arm, base) = ur5();
    let model = Model::new(&arm);
    let series = FourierSeries::built_in("ur5_identification").unwrap();
    let experiment = specification(Criterion::D).experiment;
    let predict = |e: &Experiment| Prediction::of(&model, &base, e, &series, None).unwrap();
    let reference = predict(&experiment);
    let longer = predict(&Experiment { data_s: 320.0, ..experiment.clone() });
    let noisier = predict(&Experiment {
        torque_noise_nm: experiment.torque_noise_nm.iter().map(|s| 3.0 * s).collect(),
        ..experiment
    });
    for k in 0..base.rank() {
        assert!((longer.sigma[k] / reference.sigma[k] - 0.5).abs() < 1e-9);
        assert!((noisier.sigma[k] / reference.sigma[k] - 3.0).abs() < 1e-9);
    }
    assert_eq!(longer.condition.to_bits(), reference.condition.to_bits());
}
