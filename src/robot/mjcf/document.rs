//! An MJCF and the files that it includes, as one tree of elements.

use std::path::{Path, PathBuf};
use std::rc::Rc;

use roxmltree::{Document, Node, ParsingOptions};

use super::element::Element;
use super::fault::MjcfFault;
use crate::input::{read_text, without_mark};

/// Largest nesting depth of elements: no arm needs more, and the stack can hold it.
const DEEPEST: usize = 200;

/// Whether the text of an .xml is a URDF.
pub(in crate::robot) fn is_urdf(text: &str) -> bool {
    parsed(text).is_ok_and(|document| document.root_element().tag_name().name() == "robot")
}

/// The root element of an MJCF with all included files in place, and the paths of these files; `source` is the path of
/// `text`.
pub(super) fn document(text: &str, source: &str) -> Result<(Element, Vec<PathBuf>), MjcfFault> {
    let source = Path::new(source);
    let folder = folder(source);
    let known = vec![known(source)];
    let mut includes = Includes { folder: folder.clone(), known, files: Vec::new() };
    let root = includes.root(&File::new(text, None, folder), 0)?;
    Ok((root, includes.files))
}

fn parsed(text: &str) -> Result<Document<'_>, roxmltree::Error> {
    // Like MuJoCo, this skips a document type declaration.
    let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    Document::parse_with_options(without_mark(text), options)
}

fn folder(file: &Path) -> PathBuf {
    file.parent().unwrap_or(Path::new("")).to_owned()
}

/// The canonical path of a file, which is the same however its name was written.
fn known(file: &Path) -> PathBuf {
    file.canonicalize().unwrap_or_else(|_| file.to_owned())
}

/// A text, and what is needed to tell the line of an element in it.
struct File<'t> {
    text: &'t str,
    /// Positions of its line ends.
    ends: Vec<usize>,
    /// Its name as written in `<include>`; `None` for the main file.
    name: Option<Rc<str>>,
    folder: PathBuf,
}

impl<'t> File<'t> {
    fn new(text: &'t str, name: Option<Rc<str>>, folder: PathBuf) -> Self {
        let text = without_mark(text);
        let ends = text.match_indices('\n').map(|(at, _)| at).collect();
        Self { text, ends, name, folder }
    }

    fn line(&self, node: Node<'_, '_>) -> usize {
        let start = node.range().start;
        self.ends.partition_point(|end| *end < start) + 1
    }
}

/// The files included so far.
struct Includes {
    /// Folder of the main file: MuJoCo looks there for the files that included files include.
    folder: PathBuf,
    known: Vec<PathBuf>,
    files: Vec<PathBuf>,
}

impl Includes {
    fn root(&mut self, file: &File<'_>, depth: usize) -> Result<Element, MjcfFault> {
        let document = parsed(file.text).map_err(|e| MjcfFault::Xml {
            file: file.name.as_ref().map(|name| format!("{name}: ")).unwrap_or_default(),
            message: e.to_string(),
        })?;
        let root = self.element(document.root_element(), file, depth)?;
        let is_included = file.name.is_some();
        // The root element of an included file may have any name.
        match root.tag.as_str() {
            "mujoco" => Ok(root),
            _ if is_included => Ok(root),
            _ => Err(MjcfFault::NotMjcf { place: root.place() }),
        }
    }

    fn element(
        &mut self,
        node: Node<'_, '_>,
        file: &File<'_>,
        depth: usize,
    ) -> Result<Element, MjcfFault> {
        let attributes =
            node.attributes().map(|one| (one.name().to_owned(), one.value().to_owned()));
        let mut element = Element {
            tag: node.tag_name().name().to_owned(),
            attributes: attributes.collect(),
            children: Vec::new(),
            file: file.name.clone(),
            line: file.line(node),
        };
        if depth > DEEPEST {
            return Err(MjcfFault::TooDeep { place: element.place() });
        }
        for node in node.children().filter(|node| node.is_element()) {
            let child = self.element(node, file, depth + 1)?;
            if child.tag == "include" {
                element.children.extend(self.included(&child, file, depth + 1)?);
            } else {
                element.children.push(child);
            }
        }
        Ok(element)
    }

    /// The elements that replace `include`.
    fn included(
        &mut self,
        include: &Element,
        from: &File<'_>,
        depth: usize,
    ) -> Result<Vec<Element>, MjcfFault> {
        let name = include.required("file")?;
        let beside_main = self.folder.join(name);
        let path = if beside_main.exists() { beside_main } else { from.folder.join(name) };
        let file = || path.display().to_string();
        if self.known.contains(&known(&path)) {
            return Err(MjcfFault::IncludedTwice { place: include.place(), file: file() });
        }
        self.known.push(known(&path));
        let text = read_text(&path).map_err(|e| MjcfFault::Include {
            place: include.place(),
            file: file(),
            reason: e.to_string(),
        })?;
        let file = File::new(&text, Some(name.into()), folder(&path));
        let root = self.root(&file, depth)?;
        self.files.push(path);
        Ok(root.children)
    }
}
