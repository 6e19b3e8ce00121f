//! Settings for the interpretation of a file: its `<compiler>`.

use super::element::Element;
use super::fault::MjcfFault;

/// Whether the inertia of a body is computed from its geoms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum FromGeoms {
    /// Always, whatever `<inertial>` says.
    Always,
    /// If there is no `<inertial>`.
    Auto,
    /// Never.
    Never,
}

/// The settings that matter to an arm.
#[derive(Debug, Clone)]
pub(super) struct Compiler {
    /// Unit of angles, rad.
    pub angle_rad: f64,
    /// Axes of `euler`: lower-case letters turn with the frame, capitals are fixed in the parent.
    pub eulerseq: [char; 3],
    /// Whether a range alone means that a quantity is limited.
    pub autolimits: bool,
    /// Source of the inertia.
    pub from_geoms: FromGeoms,
    /// First and last group of the geoms that contribute to the inertia.
    pub groups: [f64; 2],
    /// Whether principal moments that no body can have are replaced by their mean.
    pub balances: bool,
    /// Lower bound of the mass of a body, kg.
    pub least_mass_kg: f64,
    /// Lower bound of the principal moments of a body, kg m².
    pub least_moment_kg_m2: f64,
    /// Folder of the meshes, relative to that of the main file.
    pub mesh_folder: String,
}

impl Default for Compiler {
    fn default() -> Self {
        Self {
            angle_rad: 1.0_f64.to_radians(),
            eulerseq: ['x', 'y', 'z'],
            autolimits: true,
            from_geoms: FromGeoms::Auto,
            groups: [0.0, 5.0],
            balances: false,
            least_mass_kg: 0.0,
            least_moment_kg_m2: 0.0,
            mesh_folder: String::new(),
        }
    }
}

impl Compiler {
    /// The combined settings of all `<compiler>` elements of a file.
    pub(super) fn of(root: &Element) -> Result<Self, MjcfFault> {
        let usual = Self::default();
        let Some(said) = root.settings("compiler") else { return Ok(usual) };
        match said.text("coordinate") {
            None | Some("local") => {}
            Some(_) => return Err(said.unread("coordinates other than local ones are")),
        }
        if said.number("settotalmass")?.is_some_and(|total_kg| total_kg > 0.0) {
            return Err(said.unread("a total mass (settotalmass) is"));
        }
        Ok(Self {
            angle_rad: match said.text("angle") {
                None | Some("degree") => usual.angle_rad,
                Some("radian") => 1.0,
                Some(other) => return Err(said.keyword("angle", other, "degree, radian")),
            },
            eulerseq: match said.text("eulerseq") {
                None => usual.eulerseq,
                Some(text) => sequence(text).ok_or_else(|| {
                    said.keyword("eulerseq", text, "three of x, y, z, X, Y, Z, such as xyz")
                })?,
            },
            autolimits: said.switch("autolimits")?.unwrap_or(usual.autolimits),
            from_geoms: match said.switch("inertiafromgeom")? {
                Some(true) => FromGeoms::Always,
                Some(false) => FromGeoms::Never,
                None => FromGeoms::Auto,
            },
            groups: said.numbers::<2>("inertiagrouprange")?.unwrap_or(usual.groups),
            balances: said.switch("balanceinertia")?.unwrap_or(usual.balances),
            least_mass_kg: said.not_negative("boundmass")?,
            least_moment_kg_m2: said.not_negative("boundinertia")?,
            mesh_folder: said
                .text("meshdir")
                .or(said.text("assetdir"))
                .unwrap_or_default()
                .to_owned(),
        })
    }

    /// The range that limits a quantity, in the file's unit; `None` if it is not limited.
    pub(super) fn limit(
        &self,
        element: &Element,
        limited: &'static str,
        range: &'static str,
    ) -> Result<Option<[f64; 2]>, MjcfFault> {
        let [lower, upper] = element.numbers::<2>(range)?.unwrap_or_default();
        let said = element.switch(limited)?;
        // If the range was meant as a limit, ignoring it would move the arm into its end stops.
        if said.is_none() && !self.autolimits && lower != upper {
            return Err(MjcfFault::LimitLeftOpen { place: element.place(), range, limited });
        }
        let is_limited = said.unwrap_or(lower != upper);
        if is_limited && lower >= upper {
            return Err(MjcfFault::Range {
                place: element.place(),
                attribute: range,
                lower,
                upper,
            });
        }
        Ok(is_limited.then_some([lower, upper]))
    }
}

fn sequence(text: &str) -> Option<[char; 3]> {
    let axes: Vec<char> = text.chars().filter(|axis| "xyzXYZ".contains(*axis)).collect();
    if axes.len() != text.chars().count() {
        return None;
    }
    axes.try_into().ok()
}
