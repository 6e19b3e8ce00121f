//! Damage that recorders, copying and wrong columns do to a sound log.

use armid::diagnose::candidates::{self, Candidate};

/// A sound log of at least 700 rows and three joints, comma separated: time, then angles, velocities and efforts of all
/// joints, then any other columns.
pub struct Sound<'a> {
    /// Header line, with its line end.
    pub header: &'a str,
    pub rows: Vec<&'a str>,
    pub joints: usize,
}

impl Sound<'_> {
    /// The undamaged log.
    pub fn text(&self) -> String {
        self.of(&self.rows)
    }

    /// All damaged versions, each with the name of the damage.
    pub fn damaged(&self) -> Vec<(&'static str, String)> {
        let (rows, n) = (&self.rows, self.joints);
        let [q, qd, effort] = [0, n, 2 * n].map(|before| move |joint: usize| before + joint);
        let of_all = |quantity: usize| quantity * n + 1..(quantity + 1) * n + 1;
        let (angles, velocities, efforts) = (of_all(0), of_all(1), of_all(2));
        let one = |field: usize| field..field + 1;
        let (middle, last) = (rows.len() / 2, rows.len() - 1);
        let plain = self.text();
        let hung = [&rows[..300], &[rows[300]; 300][..], &rows[600..]].concat();
        let jitter_s = |k: usize| 0.002 / 6.0 * ((k * 7919 % 13) as f64 - 6.0);
        let spike = |k: usize| if k.is_multiple_of(37) { 50.0 } else { 0.0 };
        let alternating = |k: usize| if k.is_multiple_of(2) { -1.0 } else { 1.0 };
        vec![
            ("nothing", plain.clone()),
            ("an angle for its velocity", self.exchanged(q(1), qd(1))),
            ("an angle for an effort", self.exchanged(q(2), effort(2))),
            ("the time for an angle", self.exchanged(0, q(3))),
            ("every row written twice", self.of(rows.iter().flat_map(|row| [row, row]))),
            ("the last row first", self.of(rows.iter().rev())),
            ("semicolons", plain.replace(',', ";")),
            ("a time that is no number", self.with_field(0, 0, "NaN")),
            ("an angle beyond all bounds", self.with_field(10, q(1), "1e293")),
            ("an effort beyond all bounds", self.with_field(last, effort(n), "-1e293")),
            ("an effort without end", self.with_field(middle, effort(2), "inf")),
            ("a velocity left out", self.with_field(middle, qd(2), "")),
            ("all is cut off", String::new()),
            ("a byte is left", plain[..1].to_owned()),
            ("97 bytes are left", plain[..97].to_owned()),
            ("5000 bytes are left", plain[..5000].to_owned()),
            ("half is left", plain[..plain.len() / 2 + 3].to_owned()),
            ("the last byte is cut off", plain[..plain.len() - 1].to_owned()),
            ("an angle that stands still", self.recalculated(one(q(1)), |_, _| 0.3)),
            ("a velocity that is zero", self.recalculated(one(qd(2)), |_, _| 0.0)),
            ("velocities that are zero", self.recalculated(velocities.clone(), |_, _| 0.0)),
            ("an arm that stands still", self.recalculated(1..2 * n + 1, |_, _| 0.0)),
            (
                "an effort that is another's",
                self.with(|_, row| row[effort(n)] = row[effort(2)].clone()),
            ),
            ("an effort that is zero", self.recalculated(one(effort(n)), |_, _| 0.0)),
            ("efforts without the arm", self.recalculated(efforts, |k, _| alternating(k))),
            ("spikes of an effort", self.recalculated(one(effort(1)), |k, nm| nm + spike(k))),
            ("spikes of an angle", self.recalculated(one(q(2)), |k, rad| rad + spike(k))),
            ("angles of the other sign", self.recalculated(angles, |_, rad| -rad)),
            ("velocities of the other sign", self.recalculated(velocities, |_, rad_s| -rad_s)),
            ("time in nanoseconds", self.recalculated(one(0), |_, s| 1e9 * s)),
            ("time since 1970", self.recalculated(one(0), |_, s| 1.7e9 + s)),
            ("time that stands still", self.recalculated(one(0), |_, _| 1.0)),
            (
                "time with a pause",
                self.recalculated(one(0), |k, s| if k > middle { 1e3 + s } else { s }),
            ),
            ("time that is uneven", self.recalculated(one(0), |k, s| s + jitter_s(k))),
            ("every second row lost", self.of(rows.iter().step_by(2))),
            ("nine of ten rows lost", self.of(rows.iter().step_by(10))),
            ("a recorder that hung", self.of(hung)),
        ]
    }

    fn of(&self, rows: impl IntoIterator<Item = impl AsRef<str>>) -> String {
        let mut text = self.header.to_owned();
        for row in rows {
            text += row.as_ref();
            text.push('\n');
        }
        text
    }

    /// The log with the fields of every row modified.
    fn with(&self, change: impl Fn(usize, &mut [String])) -> String {
        self.of(self.rows.iter().enumerate().map(|(k, row)| {
            let mut fields: Vec<String> = row.split(',').map(str::to_owned).collect();
            change(k, &mut fields);
            fields.join(",")
        }))
    }

    fn with_field(&self, row: usize, field: usize, value: &str) -> String {
        self.with(|k, fields| {
            if k == row {
                fields[field] = value.to_owned();
            }
        })
    }

    /// The log with two columns exchanged under their names.
    fn exchanged(&self, a: usize, b: usize) -> String {
        self.with(|_, row| row.swap(a, b))
    }

    /// The log with the numbers in some columns replaced by `value` of row and number.
    fn recalculated(
        &self,
        columns: std::ops::Range<usize>,
        value: impl Fn(usize, f64) -> f64,
    ) -> String {
        self.with(|k, row| {
            for field in &mut row[columns.clone()] {
                *field = value(k, field.trim().parse().unwrap()).to_string();
            }
        })
    }
}

/// A few families suffice for a damaged log, because damage acts on the reader and the processing.
pub fn few_families() -> Vec<Box<dyn Candidate>> {
    let wanted = ["presliding", "load_friction", "ripple", "time_skew"];
    let all = candidates::all().into_iter();
    all.filter(|family| wanted.contains(&family.kind().name())).collect()
}
