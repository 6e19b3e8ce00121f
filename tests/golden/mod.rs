//! Reads the golden files written by `dynamics.py`, which describes the formats.

use armid::robot::Arm;

/// Entries that are structurally zero for joint j's own body: m and mz.
const OWN_JOINT_ZEROS: [usize; 2] = [0, 3];

/// One random state with Pinocchio's results for it.
pub struct State {
    pub q_rad: Vec<f64>,
    pub qd_rad_s: Vec<f64>,
    pub qdd_rad_s2: Vec<f64>,
    /// Torque of bodies and rotor inertias, without friction.
    pub torque_nm: Vec<f64>,
    pub friction_nm: Vec<f64>,
    /// N × N, row by row.
    pub mass_kg_m2: Vec<f64>,
    /// Frictionless acceleration under [`State::applied_nm`].
    pub acceleration_rad_s2: Vec<f64>,
    pub kinetic_j: f64,
    pub potential_j: f64,
    /// N × 10 N, row by row: ∂torque_j/∂parameter, inertial parameters only.
    pub regressor: Vec<f64>,
}

impl State {
    /// The applied torque for the golden acceleration: 5 kg m² · q̈.
    pub fn applied_nm(&self) -> Vec<f64> {
        self.qdd_rad_s2.iter().map(|a| 5.0 * a).collect()
    }
}

/// The three golden arms, each with its states.
pub fn all() -> Vec<(Arm, Vec<State>)> {
    vec![
        (
            Arm::built_in("ur5").unwrap(),
            states(include_bytes!("dynamics_ur5.bin"), include_bytes!("regressor_ur5.bin")),
        ),
        (
            Arm::built_in("ur10e").unwrap(),
            states(include_bytes!("dynamics_ur10e.bin"), include_bytes!("regressor_ur10e.bin")),
        ),
        (
            tilted(),
            states(include_bytes!("dynamics_tilted.bin"), include_bytes!("regressor_tilted.bin")),
        ),
    ]
}

/// An arm with six random tilted axes, full inertia tensors, and gravity along none of the axes.
pub fn tilted() -> Arm {
    Arm::from_toml(include_str!("tilted.toml"), "tilted.toml").unwrap()
}

fn states(dynamics: &[u8], regressor: &[u8]) -> Vec<State> {
    let mut values = Reader(dynamics);
    let (dof, count) = values.header(b"ARMIDDYN");
    let mut blocks = Reader(regressor);
    assert_eq!(blocks.header(b"ARMIDREG"), (dof, count));
    let inputs: Vec<[Vec<f64>; 3]> =
        (0..count).map(|_| std::array::from_fn(|_| values.f32s(dof))).collect();
    let states = inputs
        .into_iter()
        .map(|[q_rad, qd_rad_s, qdd_rad_s2]| State {
            q_rad,
            qd_rad_s,
            qdd_rad_s2,
            torque_nm: values.f64s(dof),
            friction_nm: values.f64s(dof),
            mass_kg_m2: symmetric(dof, &values.f64s(dof * (dof + 1) / 2)),
            acceleration_rad_s2: values.f64s(dof),
            kinetic_j: values.f64s(1)[0],
            potential_j: values.f64s(1)[0],
            regressor: block_triangle(dof, &mut blocks),
        })
        .collect();
    assert!(values.0.is_empty() && blocks.0.is_empty(), "golden files are longer than declared");
    states
}

fn symmetric(dof: usize, upper: &[f64]) -> Vec<f64> {
    let mut full = vec![0.0; dof * dof];
    let pairs = (0..dof).flat_map(|r| (r..dof).map(move |c| (r, c)));
    for ((r, c), &value) in pairs.zip(upper) {
        full[r * dof + c] = value;
        full[c * dof + r] = value;
    }
    full
}

fn block_triangle(dof: usize, blocks: &mut Reader) -> Vec<f64> {
    let width = 10 * dof;
    let mut full = vec![0.0; dof * width];
    for joint in 0..dof {
        for body in joint..dof {
            for k in 0..10 {
                if body > joint || !OWN_JOINT_ZEROS.contains(&k) {
                    full[joint * width + 10 * body + k] = blocks.f64s(1)[0];
                }
            }
        }
    }
    full
}

struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn take<const W: usize>(&mut self) -> [u8; W] {
        let (head, rest) = self.0.split_first_chunk::<W>().expect("golden file ends early");
        self.0 = rest;
        *head
    }

    /// Reads the header: N and the number of states.
    fn header(&mut self, magic: &[u8; 8]) -> (usize, usize) {
        assert_eq!(&self.take::<8>(), magic);
        let [format, dof, count] = [(); 3].map(|()| u32::from_le_bytes(self.take()));
        assert_eq!(format, 1);
        (dof as usize, count as usize)
    }

    fn f32s(&mut self, count: usize) -> Vec<f64> {
        (0..count).map(|_| f64::from(f32::from_le_bytes(self.take()))).collect()
    }

    fn f64s(&mut self, count: usize) -> Vec<f64> {
        (0..count).map(|_| f64::from_le_bytes(self.take())).collect()
    }
}
