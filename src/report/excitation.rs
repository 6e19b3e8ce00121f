//! The page of `armid excite`: the motion with its limits, the predicted accuracy, and the volume the arm sweeps.

use crate::base::BaseSet;
use crate::excitation::design::{Design, Prediction, Specification};
use crate::excitation::export::Speed;
use crate::excitation::{ClearanceModel, LimitKind, Reference};
use crate::identify::covariance::Z_95;
use crate::identify::not_identified;
use crate::number;
use crate::robot::Arm;

use super::json::Program;
use super::plot::{
    Across, Axis, Colour, Grid, Mark, PlotError, Size, Stick, StickFigure, StickStyle, XyPlot,
};
use super::{Column, Page, ReportError, Section, Status, Table, Verdict};

/// Samples per period in the figures.
const SAMPLES: usize = 600;

/// Remark for a robot whose bodies have no collision shapes.
pub const NO_CLEARANCE: &str =
    "the robot has no capsules: its distance from itself, the floor and the cell is not watched";

/// Remark on a motion that is played more slowly than it was designed; `None` at full speed.
pub fn at_full_speed(found: &Design, speed: Speed) -> Option<String> {
    let share = speed.share();
    (share < 1.0).then(|| {
        format!(
            "Predicted σ and length are those of full speed: at a speed of {share} the motion takes {:.1} s, and tells less \
             about what depends on speed and acceleration.",
            found.excitation.duration_s() / share
        )
    })
}

/// Names of the base parameters that the motion is predicted to leave open, judged as `armid identify` does: their 95 %
/// intervals are wider than anything an arm of this size could have.
pub fn open_parameters(arm: &Arm, base: &BaseSet, prediction: &Prediction) -> Vec<String> {
    let half_widths: Vec<f64> = prediction.sigma.iter().map(|sigma| Z_95 * sigma).collect();
    let open = not_identified(arm, base, &half_widths);
    open.into_iter().map(|k| base.name(k).to_owned()).collect()
}

/// How well the parameters will be known, in words. Nominal values near zero have no meaningful relative σ, and are
/// counted beside the others.
pub fn precision_in_words(arm: &Arm, base: &BaseSet, prediction: &Prediction) -> String {
    let (known, all) = (prediction.known(), prediction.sigma.len());
    let mut words = format!("{known} of {all} parameters will be known better than their own size");
    if known > 0 {
        let [half, most] = [0.5, 0.9].map(|share| prediction.known_quantile(share));
        words += &format!(
            ", half of these to {} or better, nine tenths to {}",
            number::percent(half, 2),
            number::percent(most, 2)
        );
    }
    if known < all {
        words += &format!(
            "; of the other {}, the nominal value is zero or below the predicted σ",
            all - known
        );
    }
    let open = open_parameters(arm, base, prediction);
    if !open.is_empty() {
        words += &format!(
            "; open, with intervals wider than anything an arm of this size could have: {}",
            open.join(", ")
        );
    }
    words
}

/// The report page of a design that is played at `speed`.
pub fn page(
    arm: &Arm,
    base: &BaseSet,
    spec: &Specification,
    found: &Design,
    speed: Speed,
    program: Program,
) -> Result<Page, ReportError> {
    let is_watched = !ClearanceModel::new(arm).is_empty();
    let motion = Samples::of(arm, found);
    let precision = precision_in_words(arm, base, &found.prediction);
    let verdict = verdict(spec, found, (speed, is_watched), &precision);
    let mut page = Page::new("Excitation", subtitle(arm, found), verdict, program);
    page.push(the_motion(arm, spec, &motion, is_watched)?);
    page.push(what_it_will_tell(arm, base, found));
    page.push(margins(found));
    if is_watched {
        page.push(clearance_model(arm, &motion)?);
    }
    Ok(page)
}

fn subtitle(arm: &Arm, found: &Design) -> String {
    let series = found.excitation.series();
    format!(
        "{}, order {}, period {} s, run-in {} s",
        arm.name,
        series.order(),
        number::significant(series.period_s, 4),
        found.excitation.run_in_s()
    )
}

fn verdict(
    spec: &Specification,
    found: &Design,
    (speed, is_watched): (Speed, bool),
    precision: &str,
) -> Verdict {
    let p = &found.prediction;
    let worst = found.margins.worst();
    let limits = match is_watched {
        true => "A motion inside every limit".to_owned(),
        false => format!("A motion inside every limit of the joints ({NO_CLEARANCE})"),
    };
    let prediction = format!(
        "Predicted from {} periods, {:.1} s of data: {precision}.",
        found.excitation.periods(),
        found.experiment.data_s
    );
    let conditions = format!(
        "cond(ΘᵀΘ) {}; with columns of unit length {}.",
        number::significant(p.condition, 4),
        number::significant(p.scaled_condition, 3)
    );
    let closest = format!(
        "Closest limit: {}, {} left at {:.2} s.",
        worst.limit,
        worst.in_words(),
        worst.time_s
    );
    let facts = std::iter::once(prediction).chain(at_full_speed(found, speed));
    Verdict {
        status: if found.cut_short || !is_watched { Status::Warn } else { Status::Good },
        sentence: format!(
            "{limits}, checked at {} Hz: {}.",
            spec.requirements.check_rate_hz,
            spec.criterion.in_words(found.value)
        ),
        facts: facts.chain([conditions, closest, search_fact(found)]).collect(),
    }
}

fn search_fact(found: &Design) -> String {
    let end = if found.cut_short { "; cut short, so another run may end elsewhere" } else { "" };
    format!(
        "{} of {} random starts were feasible, {} evaluations{end}.",
        found.feasible_starts,
        found.starts,
        number::count(found.evaluations)
    )
}

fn the_motion(
    arm: &Arm,
    spec: &Specification,
    motion: &Samples,
    is_watched: bool,
) -> Result<Section, PlotError> {
    let mut section = Section::new("The motion")
        .figure(motion.against_limits(arm, 0)?, "Angles; dashed: limits.")
        .figure(
            motion.against_limits(arm, 1)?,
            "Velocities; dashed: what the motion may use of the limits.",
        )
        .figure(motion.against_limits(arm, 2)?, "Accelerations; dashed: limits.");
    if is_watched {
        let caption = "Smallest distances over one period; dashed: what is required.";
        section = section.figure(motion.clearance(arm, spec)?, caption);
    }
    let caption = "Postures over one period (pale), where it is closest to itself, and the way of the flange.";
    Ok(section.figure(swept(arm, motion)?, caption))
}

fn what_it_will_tell(arm: &Arm, base: &BaseSet, found: &Design) -> Section {
    Section::new("What it will tell")
        .paragraph(
            "Standard deviations by weighted least squares from white torque noise, before any experiment is run. \
             Parameters that are zero for this arm have no relative σ; where it exceeds 100 %, the nominal value is smaller \
             than σ, and the motion tells how small the parameter is.",
        )
        .table(parameters(arm, base, found), "")
}

fn margins(found: &Design) -> Section {
    Section::new("Margins").table(
        margin_table(found),
        "What the whole motion, run-in and run-out included, leaves free, also as a share of half the range of a position, of \
         the largest velocity, acceleration or torque, and of 0.1 m of clearance.",
    )
}

fn clearance_model(arm: &Arm, motion: &Samples) -> Result<Section, PlotError> {
    let section = Section::new("Clearance model")
        .paragraph("Capsules fixed in the bodies; ends in the joint frame of the body, body 0 is the base.")
        .table(capsules(arm), "");
    Ok(section
        .figure(drawn_capsules(arm, motion)?, "Axes of the capsules at the start of the period."))
}

/// One period, sampled at [`SAMPLES`] + 1 instants.
struct Samples {
    time_s: Vec<f64>,
    /// q, q̇, q̈ by joint.
    states: [Vec<Vec<f64>>; 3],
    /// Distances over time, by the index of the clearance model.
    distances_m: Vec<Vec<f64>>,
}

impl Samples {
    fn of(arm: &Arm, found: &Design) -> Self {
        let series = found.excitation.series();
        let n = arm.dof();
        let clearance = ClearanceModel::new(arm);
        let mut ws = clearance.workspace();
        let mut out = Self {
            time_s: Vec::new(),
            states: std::array::from_fn(|_| vec![Vec::new(); n]),
            distances_m: vec![Vec::new(); clearance.len()],
        };
        let [mut q, mut qd, mut qdd]: [Vec<f64>; 3] = std::array::from_fn(|_| vec![0.0; n]);
        let mut d = vec![0.0; clearance.len()];
        for k in 0..=SAMPLES {
            let t_s = series.period_s * k as f64 / SAMPLES as f64;
            series.sample(t_s, &mut q, &mut qd, &mut qdd);
            clearance.distances(&mut ws, &q, &mut d);
            out.time_s.push(t_s);
            for (rows, values) in out.states.iter_mut().zip([&q, &qd, &qdd]) {
                for (row, value) in rows.iter_mut().zip(values) {
                    row.push(*value);
                }
            }
            for (row, value) in out.distances_m.iter_mut().zip(&d) {
                row.push(*value);
            }
        }
        out
    }

    fn against_limits(&self, arm: &Arm, which: usize) -> Result<String, PlotError> {
        let (label, unit) = [("q", "rad"), ("q̇", "rad/s"), ("q̈", "rad/s²")][which];
        let panels =
            arm.joints.iter().zip(&self.states[which]).enumerate().map(|(j, (joint, y))| {
                let limits = &joint.limits;
                let [low, high] = match which {
                    0 => limits.position_rad,
                    1 => [-limits.velocity_rad_s, limits.velocity_rad_s],
                    _ => [-limits.acceleration_rad_s2, limits.acceleration_rad_s2],
                };
                XyPlot::new(
                    format!("joint {}", j + 1),
                    Axis::linear("t", "s"),
                    Axis::linear(label, unit),
                )
                .with_marker(Across::Y, low, "")
                .with_marker(Across::Y, high, "")
                .with("", &self.time_s, y, Colour::MEASURED, Mark::Line)
            });
        let (x, y) = (Axis::linear("t", "s"), Axis::linear(label, unit));
        Grid { panels: panels.collect(), ..Grid::new("", x, y) }.to_svg()
    }

    fn clearance(&self, arm: &Arm, spec: &Specification) -> Result<String, PlotError> {
        const SHOWN: usize = 5;
        let model = ClearanceModel::new(arm);
        let mut plot =
            XyPlot::new("Clearance", Axis::linear("t", "s"), Axis::linear("distance", "m"))
                .with_marker(Across::Y, spec.requirements.clearance_m, "required");
        let mut order: Vec<usize> = (0..self.distances_m.len()).collect();
        let least = |k: usize| self.distances_m[k].iter().copied().fold(f64::INFINITY, f64::min);
        order.sort_by(|&a, &b| least(a).total_cmp(&least(b)));
        for (shown, &k) in order.iter().take(SHOWN).enumerate() {
            let name = match model.limit(k) {
                LimitKind::Clearance { one, other } => format!("{one} – {other}"),
                LimitKind::Floor { capsule } => format!("{capsule} – floor"),
                LimitKind::Box { capsule, which } => format!("{capsule} – box {}", which + 1),
                joint_limit => joint_limit.to_string(),
            };
            plot = plot.with(
                name,
                &self.time_s,
                &self.distances_m[k],
                Colour::series(shown),
                Mark::Line,
            );
        }
        plot.to_svg()
    }

    /// Index of the sample with the smallest distance.
    fn closest(&self) -> usize {
        let least = |k: usize| self.distances_m.iter().map(|d| d[k]).fold(f64::INFINITY, f64::min);
        (0..self.time_s.len()).min_by(|&a, &b| least(a).total_cmp(&least(b))).unwrap_or(0)
    }

    fn pose(&self, k: usize) -> Vec<f64> {
        self.states[0].iter().map(|row| row[k]).collect()
    }
}

/// Points of the arm's centre line at one pose: the base origin, then the origin of every body's frame.
fn skeleton(arm: &Arm, q_rad: &[f64]) -> Vec<[f64; 3]> {
    std::iter::once([0.0; 3])
        .chain(arm.frames(q_rad).iter().map(|f| f.translation_m.into()))
        .collect()
}

fn swept(arm: &Arm, motion: &Samples) -> Result<String, PlotError> {
    const POSTURES: usize = 24;
    let mut sticks: Vec<Stick> = (0..POSTURES)
        .map(|k| Stick {
            name: String::new(),
            points_m: skeleton(arm, &motion.pose(k * SAMPLES / POSTURES)),
            colour: Colour::REFERENCE,
            style: StickStyle::Trail,
        })
        .collect();
    let flange =
        (0..=SAMPLES).filter_map(|k| skeleton(arm, &motion.pose(k)).last().copied()).collect();
    sticks.push(Stick {
        name: "flange".into(),
        points_m: flange,
        colour: Colour::MODEL,
        style: StickStyle::Path,
    });
    if !motion.distances_m.is_empty() {
        sticks.push(Stick {
            name: "closest".into(),
            points_m: skeleton(arm, &motion.pose(motion.closest())),
            colour: Colour::MEASURED,
            style: StickStyle::Posture,
        });
    }
    StickFigure { title: "The swept arm".into(), sticks, size: Size::wide(420.0) }.to_svg()
}

fn drawn_capsules(arm: &Arm, motion: &Samples) -> Result<String, PlotError> {
    let model = ClearanceModel::new(arm);
    let placed = model.capsules_at(&motion.pose(0));
    let sticks =
        arm.clearance.capsules.iter().zip(placed).enumerate().map(|(k, (capsule, (ends, _)))| {
            Stick {
                name: capsule.name.clone(),
                points_m: ends.iter().map(|&end| end.into()).collect(),
                colour: Colour::series(k),
                style: StickStyle::Posture,
            }
        });
    StickFigure { title: "Capsule axes".into(), sticks: sticks.collect(), size: Size::wide(420.0) }
        .to_svg()
}

fn parameters(arm: &Arm, base: &BaseSet, found: &Design) -> Table {
    let model = crate::dynamics::Model::new(arm);
    let theta = base.values(&model.standard_parameters());
    let mut table = Table::new([
        Column::text("parameter"),
        Column::number("nominal", ""),
        Column::number("σ", ""),
        Column::text("unit"),
        Column::number("relative σ", ""),
    ]);
    let p = &found.prediction;
    for (k, value) in theta.iter().enumerate() {
        let relative = p.relative_sigma[k];
        let share =
            if relative.is_finite() { number::percent(relative, 2) } else { "—".to_owned() };
        table.push([
            base.formula(k),
            number::significant(*value, 4),
            number::significant(p.sigma[k], 2),
            base.unit(k).to_owned(),
            share,
        ]);
    }
    table
}

fn margin_table(found: &Design) -> Table {
    let mut table = Table::new([
        Column::text("limit"),
        Column::number("left", ""),
        Column::text("unit"),
        Column::number("of the limit", "%"),
        Column::number("at", "s"),
    ]);
    for margin in found.margins.least_first() {
        table.push([
            margin.limit.to_string(),
            number::significant(margin.free, 3),
            margin.limit.unit().to_owned(),
            format!("{:.1}", 100.0 * margin.share),
            format!("{:.3}", margin.time_s),
        ]);
    }
    table
}

fn capsules(arm: &Arm) -> Table {
    let mut table = Table::new([
        Column::text("capsule"),
        Column::number("body", ""),
        Column::number("radius", "m"),
        Column::text("from (m)"),
        Column::text("to (m)"),
    ]);
    for c in &arm.clearance.capsules {
        let point = |v: &nalgebra::Vector3<f64>| format!("{:.4}, {:.4}, {:.4}", v.x, v.y, v.z);
        table.push([
            c.name.clone(),
            c.body.to_string(),
            format!("{:.3}", c.radius_m),
            point(&c.from_m),
            point(&c.to_m),
        ]);
    }
    table
}
