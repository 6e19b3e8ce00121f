"""A UR5 in MuJoCo that writes the log of a motion, with one effect hidden in it or none.

Nothing of armid takes part: the arm is read from robots/ur5.toml, the motion from trajectories/*.json. Every effect acts
where it arises: friction, gears and contacts in the equations of motion at each stage of the integrator, bodies and gravity
in the model, timing and readings in the record. Friction is F_v qd + F_c tanh(qd/eps), by armid's conventions.

The drive holds its torque from one step to the next; what is logged is the mean of what was held before and after.
"""

import json
import math
import tomllib
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
TORQUE_SD_NM = np.array([1.0, 1.0, 0.7, 0.15, 0.15, 0.15])
Q_SD_RAD = 2e-5
QD_SD_RAD_S = 1e-3


@dataclass
class Drive:
    """Feedback about a reference, through the mean diagonal of the mass matrix."""

    model_feedforward: bool = True  # inverse dynamics of the reference; else gravity only
    friction_feedforward: float = 0.9  # share of Coulomb friction; viscous friction in full
    bandwidth_rad_s: float = 50.0


@dataclass
class Run:
    trajectory: str = "ur5_identification"
    periods: int = 8
    rate_hz: int = 125
    step_s: float = 1e-3
    drive: Drive = field(default_factory=Drive)
    effect: dict = field(default_factory=dict)  # {"kind": ..., "joint": from 1, ...}
    seed: int = 1


class Arm:
    """The robot file as MuJoCo models: what the controller believes, and the true one."""

    def __init__(self, run):
        self.file = tomllib.loads((ROOT / "robots/ur5.toml").read_text())
        self.joints = self.file["joint"]
        self.epsilon = self.file["friction_epsilon_rad_s"]
        self.coulomb = np.array([j["coulomb_nm"] for j in self.joints])
        self.viscous = np.array([j["viscous_nm_s_rad"] for j in self.joints])
        self.rotor = np.array([j["rotor_inertia_kg_m2"] for j in self.joints])
        self.believed = mujoco.MjModel.from_xml_string(self.xml(run.step_s, {}))
        self.true = mujoco.MjModel.from_xml_string(self.xml(run.step_s, run.effect))

    def xml(self, step_s, effect):
        kind, site = effect.get("kind"), effect.get("joint", 0) - 1
        gravity = self.file["gravity_m_s2"]
        if kind == "base_tilt":
            x, y = effect["tilt_x_rad"], effect["tilt_y_rad"]
            g = -gravity[2]
            gravity = [g * math.sin(y), -g * math.sin(x) * math.cos(y), -g * math.cos(x) * math.cos(y)]
        text = lambda values: " ".join(f"{v!r}" for v in values)
        out = (
            '<mujoco><compiler angle="radian" eulerseq="XYZ"/>'
            f'<option timestep="{step_s}" integrator="RK4" gravity="{text(gravity)}">'
            '<flag contact="disable"/></option><worldbody>'
        )
        bodies = 0
        for i, j in enumerate(self.joints):
            xyz = list(j["xyz_m"])
            tensor = j["inertia_com_kg_m2"]
            full = [tensor[k] for k in ("xx", "yy", "zz", "xy", "xz", "yz")]
            out += f'<body pos="{text(xyz)}" euler="{text(j["rpy_rad"])}">'
            motor = f'<joint name="j{i}" axis="0 0 1" armature="{j["rotor_inertia_kg_m2"]}"/>'
            bodies += 1
            if kind in ("elasticity", "backlash") and site == i:
                # The rotor is a body of its own; the link turns against it.
                out += motor + '<inertial pos="0 0 0" mass="1e-6" diaginertia="1e-9 1e-9 1e-9"/>'
                out += '<body><joint name="gear" axis="0 0 1"/>'
                motor = ""
                bodies += 1
            out += (
                f'<inertial pos="{text(j["com_m"])}" mass="{j["mass_kg"]}" fullinertia="{text(full)}"/>{motor}'
            )
        motors = "".join(f'<motor joint="j{i}"/>' for i in range(len(self.joints)))
        return f"{out}{'</body>' * bodies}</worldbody><actuator>{motors}</actuator></mujoco>"


class Reference:
    """The periodic motion: velocity is a sum of a cos + b sin of the harmonics, the angle its integral."""

    def __init__(self, name):
        file = json.loads((ROOT / f"trajectories/{name}.json").read_text())
        self.period_s = file["period_s"]
        self.q0 = np.array(file["q0_rad"])
        self.a, self.b = np.array(file["a_rad_s"]), np.array(file["b_rad_s"])
        self.w = 2 * math.pi / self.period_s * np.arange(1, self.a.shape[1] + 1)

    def at(self, t):
        s, c, w = np.sin(self.w * t), np.cos(self.w * t), self.w
        return (
            self.q0 + (self.a / w) @ s - (self.b / w) @ c,
            self.a @ c + self.b @ s,
            (-self.a * w) @ s + (self.b * w) @ c,
        )


class Physics:
    """Torques beside those of the rigid arm, asked for at every stage of the integrator."""

    def __init__(self, arm, effect, motors, gear, start_s):
        self.arm, self.effect, self.motors, self.gear = arm, effect, motors, gear
        self.kind, self.site = effect.get("kind"), effect.get("joint", 0) - 1
        self.start_s, self.now_s = start_s, 0.0
        self.bristle, self.from_rad = 0.0, 0.0
        self.load_nm = np.zeros(len(motors))

    def friction(self, q, v):
        arm, e, j = self.arm, self.effect, self.site
        width = np.full(len(v), arm.epsilon)
        turned = j if j >= 0 else slice(None)
        if "width_rad_s" in e:
            width[turned] = e["width_rad_s"]
        sign = np.tanh(v / width)
        if "algebraic_width_rad_s" in e:
            sign[turned] = v[turned] / np.sqrt(v[turned] ** 2 + e["algebraic_width_rad_s"] ** 2)
        out = arm.coulomb * sign + arm.viscous * v
        if self.kind == "presliding":
            # Dahl: dz/dq = k (1 - z sgn) over the way since the step began.
            way = 1.0 if v[j] >= 0 else -1.0
            fade = math.exp(-e["stiffness_per_rad"] * abs(q[j] - self.from_rad))
            out[j] += arm.coulomb[j] * (way + (self.bristle - way) * fade - sign[j])
        elif self.kind == "stribeck":
            out[j] += e["extra_nm"] * math.exp(-((v[j] / e["vs_rad_s"]) ** 2)) * sign[j]
        elif self.kind == "load_friction":
            out[j] += e["mu"] * abs(self.load_nm[j]) * sign[j]
        elif self.kind == "asymmetric_friction":
            out[j] += e["viscous_nm_s_rad"] * abs(v[j])
        elif self.kind == "nonlinear_viscous":
            out[j] += e["amplitude_nm"] * math.copysign(abs(v[j]) ** e["exponent"], v[j])
        elif self.kind == "position_friction":
            out[j] += e["amplitude_nm"] * math.sin(q[j] + 0.5) * sign[j]
        return out

    def __call__(self, _model, data):
        q, v = data.qpos[self.motors], data.qvel[self.motors]
        torque, e, j = -self.friction(q, v), self.effect, self.site
        if self.kind == "ripple":
            torque[j] -= e["amplitude_nm"] * math.sin(e["order_per_turn"] * q[j] + 0.7)
        elif self.kind == "spring":
            torque[j] -= e["stiffness_nm_rad"] * (q[j] - e["rest_rad"])
        elif self.kind == "contact":
            phase = (self.now_s - self.start_s - e["start_s"]) / (e["end_s"] - e["start_s"])
            if 0 < phase < 1:
                torque[j] += e["peak_nm"] * math.sin(math.pi * phase) ** 2
        data.qfrc_passive[self.motors] += torque
        if self.gear is not None:
            angle, rate = data.qpos[self.gear], data.qvel[self.gear]
            half = e.get("gap_rad", 0.0) / 2
            pressed = angle - math.copysign(half, angle) if abs(angle) > half else 0.0
            touches = 1.0 if half == 0.0 or pressed else 0.0
            data.qfrc_passive[self.gear] -= e["flank_nm_rad"] * pressed + touches * e["flank_nm_s_rad"] * rate

    def begin_step(self, torque_nm, q, v, qdd, now_s):
        """States that change from step to step: the bristle, the load, the time."""
        if self.kind == "presliding":
            way = 1.0 if v[self.site] >= 0 else -1.0
            fade = math.exp(-self.effect["stiffness_per_rad"] * abs(q[self.site] - self.from_rad))
            self.bristle = way + (self.bristle - way) * fade
            self.from_rad = q[self.site]
        if self.kind == "load_friction":
            self.load_nm = torque_nm - self.friction(q, v) - self.arm.rotor * qdd
        self.now_s = now_s


def feedforward(arm, reference, drive, steps, step_s):
    """Torque and reference at every step of a period, and the mean diagonal of the mass matrix."""
    data = mujoco.MjData(arm.believed)
    mass = np.zeros((arm.believed.nv, arm.believed.nv))
    out, inertia, samples = [], np.zeros(arm.believed.nv), 0
    for n in range(steps):
        q, v, acceleration = reference.at(n * step_s)
        data.qpos[:] = q
        data.qvel[:] = v if drive.model_feedforward else 0.0
        data.qacc[:] = acceleration if drive.model_feedforward else 0.0
        mujoco.mj_inverse(arm.believed, data)
        torque = data.qfrc_inverse.copy()
        if drive.model_feedforward:
            torque += arm.viscous * v + drive.friction_feedforward * arm.coulomb * np.tanh(v / arm.epsilon)
        if n % 200 == 0:
            mujoco.mj_fullM(arm.believed, data, mass)
            inertia += np.diag(mass)
            samples += 1
        out.append((q, v, torque))
    return out, inertia / samples


def simulate(run):
    """Time (s), angles (rad), velocities (rad/s) and torques (Nm) of one run, with the sensors' noise."""
    mujoco.set_mjcb_passive(None)
    arm, reference, effect = Arm(run), Reference(run.trajectory), run.effect
    kind, site = effect.get("kind"), effect.get("joint", 0) - 1
    steps = round(reference.period_s / run.step_s)
    wanted, inertia = feedforward(arm, reference, run.drive, steps, run.step_s)
    stiffness, damping = inertia * run.drive.bandwidth_rad_s**2, 2 * inertia * run.drive.bandwidth_rad_s
    data = mujoco.MjData(arm.true)
    address = lambda name: mujoco.mj_name2id(arm.true, mujoco.mjtObj.mjOBJ_JOINT, name)
    motors = np.array([address(f"j{i}") for i in range(len(arm.joints))])
    gear = address("gear") if kind in ("elasticity", "backlash") else None
    physics = Physics(arm, effect, motors, gear, reference.period_s)
    mujoco.set_mjcb_passive(physics)
    data.qpos[motors], data.qvel[motors] = wanted[0][0], wanted[0][1]
    # One period to settle, and a little more than the log for channels that are read late.
    total = (run.periods + 1) * steps + round(0.3 / run.step_s)
    q_all, v_all, torque_all = (np.zeros((total, len(motors))) for _ in range(3))
    offset = effect["offset_rad"] if kind == "encoder_offset" else 0.0
    for n in range(total):
        q_wanted, v_wanted, torque = wanted[n % steps]
        q, v = data.qpos[motors].copy(), data.qvel[motors].copy()
        physics.begin_step(data.ctrl.copy(), q, v, data.qacc[motors], n * run.step_s)
        read = q.copy()
        if kind == "encoder_offset":
            read[site] += offset
        torque = torque + stiffness * (q_wanted - read) + damping * (v_wanted - v)
        q_all[n], v_all[n], torque_all[n] = read, v, torque
        if kind == "torque_gain":
            torque = torque.copy()
            torque[site] /= 1 + effect["error_fraction"]
        elif kind == "current_offset":
            torque = torque.copy()
            torque[site] -= effect["offset_nm"]
        data.ctrl[:] = torque
        mujoco.mj_step(arm.true, data)
    mujoco.set_mjcb_passive(None)
    torque_all[1:] = (torque_all[1:] + torque_all[:-1]) / 2
    clock = np.arange(total)
    if kind == "time_skew":
        for j in range(len(motors)) if site < 0 else [site]:
            torque_all[:, j] = np.interp(clock - effect["delay_s"] / run.step_s, clock, torque_all[:, j])
    if kind == "velocity_lag":
        share = run.step_s / (effect["delay_s"] + run.step_s)
        for n in range(1, total):
            v_all[n] = v_all[n - 1] + share * (v_all[n] - v_all[n - 1])
    rows = round(run.periods * reference.period_s * run.rate_hz)
    at = steps + np.arange(rows) * round(1 / (run.rate_hz * run.step_s))
    chance = np.random.default_rng(run.seed)
    noisy = lambda y, sd: y[at] + chance.normal(size=(rows, len(motors))) * sd
    q, v, torque = noisy(q_all, Q_SD_RAD), noisy(v_all, QD_SD_RAD_S), noisy(torque_all, TORQUE_SD_NM)
    time_s = np.arange(rows) / run.rate_hz
    if kind == "outliers":
        struck = chance.random(torque.shape) < effect["fraction"]
        torque += struck * chance.choice([-30.0, 30.0], size=torque.shape) * TORQUE_SD_NM
    if kind == "dropped_samples":
        kept = chance.random(rows) > effect["fraction"]
        time_s, q, v, torque = time_s[kept], q[kept], v[kept], torque[kept]
    return time_s, q, v, torque


def write(path, log):
    """As a CSV with RTDE names."""
    time_s, *signals = log
    names = [f"actual_{what}_{j}" for what in ("q", "qd", "torque") for j in range(signals[0].shape[1])]
    table = np.column_stack([time_s, *signals])
    np.savetxt(path, table, delimiter=",", header=",".join(["timestamp", *names]), comments="", fmt="%.9g")
