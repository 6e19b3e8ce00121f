//! `armid base`: the combinations of parameters that can be identified.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use super::robot::{inputs, load_robot_in_full};
use super::{CommandResult, Outcome};
use crate::base::{BaseSet, Parameterisation};
use crate::output::check_outputs;
use crate::report::json::{Document, Program};
use crate::report::{Column, Table};
use crate::robot::LoadedArm;

/// Print the base parameters of an arm: the combinations that torque can reveal.
#[derive(Debug, Args)]
pub struct BaseArgs {
    /// Robot: ur5, ur10e, ur3e, ur5e, or a .toml, .urdf or .xml (MJCF) file (FILE.urdf#LINK: the arm
    /// up to that link).
    #[arg(long)]
    robot: String,
    /// Reduced parameter set instead of the full one: paper.
    #[arg(long)]
    reduced: Option<String>,
    /// Write the result as JSON.
    #[arg(long)]
    json: Option<PathBuf>,
}

#[derive(Serialize)]
struct BaseResult<'a> {
    robot: &'a str,
    rank: usize,
    columns: usize,
    combinations: Vec<Combination<'a>>,
}

#[derive(Serialize)]
struct Combination<'a> {
    name: &'a str,
    terms: Vec<Term<'a>>,
}

#[derive(Serialize)]
struct Term<'a> {
    parameter: &'a str,
    coefficient: f64,
}

/// Runs the command.
pub fn run(args: &BaseArgs) -> CommandResult {
    let LoadedArm { arm, files, .. } = load_robot_in_full(&args.robot)?;
    check_outputs(&args.json, &files)?;
    let parameterisation = Parameterisation::of(&arm, args.reduced.as_deref())?;
    let set = BaseSet::find(&arm, parameterisation)?;
    let mut table =
        Table::new([Column::number("", ""), Column::text("combination"), Column::text("unit")]);
    for k in 0..set.rank() {
        table.push([(k + 1).to_string(), set.formula(k), set.unit(k).to_owned()]);
    }
    say!("{}", table.to_text());
    say!(
        "{}: {} base parameters from {} columns; outside the span of the others, independent \
         columns keep at least {:.1e} of their length, dependent ones at most {:.1e}",
        arm.name,
        set.rank(),
        set.parameterisation.count(),
        set.gap.smallest_independent,
        set.gap.largest_dependent
    );
    if let Some(path) = &args.json {
        let names = &set.parameterisation.names;
        let term =
            |&(index, coefficient): &(usize, f64)| Term { parameter: &names[index], coefficient };
        let result = BaseResult {
            robot: &arm.name,
            rank: set.rank(),
            columns: set.parameterisation.count(),
            combinations: (0..set.rank())
                .map(|k| Combination {
                    name: set.name(k),
                    terms: set.combinations[k].iter().map(term).collect(),
                })
                .collect(),
        };
        let program = Program::started(None, inputs(&files)?);
        Document { schema: "armid.base/1", program: &program, body: &result }.write(path)?;
    }
    Ok(Outcome::Done)
}
