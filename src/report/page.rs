//! A self-contained HTML page: first the verdict, then the evidence, then the origin of the result.

use std::path::Path;

use minijinja::syntax::SyntaxConfig;
use minijinja::value::Serde;
use minijinja::{AutoEscape, Environment, context};
use serde::Serialize;

use super::error::ReportError;
use super::json::Program;
use super::plot::labelled;
use super::status::Status;
use super::table::Table;
use crate::output::write_text;

/// The banner of a page: what a reader takes away who reads nothing else.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Verdict {
    /// Colour of the banner.
    pub status: Status,
    /// One plain sentence.
    pub sentence: String,
    /// A few facts that support the sentence.
    pub facts: Vec<String>,
}

/// A page under construction.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Page {
    /// Title.
    pub title: String,
    /// A line under the title: robot, log, scenario; may be empty.
    pub subtitle: String,
    /// The banner.
    pub verdict: Verdict,
    /// Further facts in the banner, collapsed; `None` if all are shown.
    pub folded: Option<Folded>,
    /// The sections, in reading order.
    pub sections: Vec<Section>,
    /// Origin of the result, for the footer.
    pub program: Program,
}

/// Facts that are collapsed behind a title.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Folded {
    /// The title.
    pub title: String,
    /// The facts.
    pub facts: Vec<String>,
}

/// A section of the page with a heading.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Section {
    title: String,
    blocks: Vec<Block>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
enum Block {
    Paragraph { text: String },
    Note { status: Status, text: String },
    List { items: Vec<String> },
    Code { text: String },
    Table { table: Table, caption: String },
    Figure { svg: String, caption: String },
    Details { summary: String, blocks: Vec<Block> },
}

impl Section {
    /// An empty section.
    pub fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), blocks: Vec::new() }
    }

    /// Adds a paragraph.
    pub fn paragraph(self, text: impl Into<String>) -> Self {
        self.with(Block::Paragraph { text: text.into() })
    }

    /// Adds a highlighted remark.
    pub fn note(self, status: Status, text: impl Into<String>) -> Self {
        self.with(Block::Note { status, text: text.into() })
    }

    /// Adds one highlighted remark for every warning.
    pub fn warnings(self, warnings: impl IntoIterator<Item = impl Into<String>>) -> Self {
        warnings.into_iter().fold(self, |section, warning| section.note(Status::Warn, warning))
    }

    /// Adds a bulleted list.
    pub fn list(self, items: impl IntoIterator<Item = impl Into<String>>) -> Self {
        self.with(Block::List { items: items.into_iter().map(Into::into).collect() })
    }

    /// Adds text in a fixed-width font, such as a command or a file.
    pub fn code(self, text: impl Into<String>) -> Self {
        self.with(Block::Code { text: text.into() })
    }

    /// Adds a table with a caption above it; the caption may be empty.
    pub fn table(self, table: Table, caption: impl Into<String>) -> Self {
        self.with(Block::Table { table, caption: caption.into() })
    }

    /// Adds a figure with a caption below it; the caption may be empty. It also labels a figure without a title for
    /// screen readers.
    ///
    /// `svg` is inserted without escaping: it must come from [`super::plot`], which escapes all text.
    pub fn figure(self, svg: impl Into<String>, caption: impl Into<String>) -> Self {
        let caption = caption.into();
        self.with(Block::Figure { svg: labelled(svg.into(), &caption), caption })
    }

    /// Adds `contents` collapsed behind its title. In print it is expanded.
    pub fn details(self, contents: Section) -> Self {
        self.with(Block::Details { summary: contents.title, blocks: contents.blocks })
    }

    fn with(mut self, block: Block) -> Self {
        self.blocks.push(block);
        self
    }
}

impl Page {
    /// A page with a verdict and no sections.
    pub fn new(
        title: impl Into<String>,
        subtitle: impl Into<String>,
        verdict: Verdict,
        program: Program,
    ) -> Self {
        Self {
            title: title.into(),
            subtitle: subtitle.into(),
            verdict,
            folded: None,
            sections: Vec::new(),
            program,
        }
    }

    /// Adds a section with the warnings, if there are any.
    pub fn with_warnings(mut self, warnings: &[String]) -> Self {
        if !warnings.is_empty() {
            self.push(Section::new("What should be known").warnings(warnings));
        }
        self
    }

    /// Adds a section.
    pub fn push(&mut self, section: Section) {
        self.sections.push(section);
    }

    /// Adds any number of sections.
    pub fn extend(&mut self, sections: impl IntoIterator<Item = Section>) {
        sections.into_iter().for_each(|section| self.push(section));
    }

    /// The page as an HTML document; equal contents give equal bytes.
    pub fn to_html(&self) -> Result<String, ReportError> {
        Ok(environment()?.get_template("page.html")?.render(context! { page => Serde(self) })?)
    }

    /// Writes the page atomically.
    pub fn write(&self, path: &Path) -> Result<(), ReportError> {
        Ok(write_text(path, &self.to_html()?)?)
    }
}

/// A table as an HTML element.
pub(super) fn render_table(table: &Table) -> Result<String, ReportError> {
    Ok(environment()?
        .get_template("table.html")?
        .render(context! { table => Serde(table), caption => "" })?)
}

fn environment() -> Result<Environment<'static>, minijinja::Error> {
    let mut environment = Environment::new();
    environment.set_syntax(SyntaxConfig::builder().trim_blocks(true).lstrip_blocks(true).build()?);
    environment.set_auto_escape_callback(|_| AutoEscape::Html);
    environment.add_template("page.html", include_str!("page.html"))?;
    environment.add_template("table.html", include_str!("table.html"))?;
    environment.add_template("page.css", include_str!("page.css"))?;
    Ok(environment)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::plot::{Axis, Colour, Mark, XyPlot};
    use crate::report::{Column, json::Input};

    const HOSTILE: &str = "<script>alert('1')</script> & \"q\"";

    fn page() -> Page {
        let verdict =
            Verdict { status: Status::Warn, sentence: HOSTILE.into(), facts: vec![HOSTILE.into()] };
        let input = Input { path: HOSTILE.into(), sha256: "0".repeat(64) };
        let mut page =
            Page::new(HOSTILE, HOSTILE, verdict, Program::new([HOSTILE], Some(1), vec![input]));
        let mut table = Table::new([Column::text(HOSTILE), Column::number(HOSTILE, HOSTILE)]);
        table.push([HOSTILE, HOSTILE]);
        let svg =
            XyPlot::new(HOSTILE, Axis::linear(HOSTILE, HOSTILE), Axis::linear(HOSTILE, HOSTILE))
                .with(HOSTILE, &[0.0, 1.0], &[0.0, 1.0], Colour::MODEL, Mark::Line)
                .to_svg()
                .unwrap();
        let hidden = Section::new(HOSTILE).code(HOSTILE).list([HOSTILE]);
        let section = Section::new(HOSTILE)
            .paragraph(HOSTILE)
            .note(Status::Bad, HOSTILE)
            .table(table, HOSTILE);
        page.folded = Some(Folded { title: HOSTILE.into(), facts: vec![HOSTILE.into()] });
        page.push(section.figure(svg, HOSTILE).details(hidden));
        page.push(Section::new("Empty"));
        page
    }

    #[test]
    fn text_from_outside_is_escaped_everywhere() {
        let html = page().to_html().unwrap();
        assert!(!html.contains("<script"), "unescaped text in the page");
        assert!(html.matches("&lt;script&gt;").count() >= 20);
    }

    #[test]
    fn the_page_needs_nothing_from_elsewhere() {
        let html = page().to_html().unwrap();
        for loads in ["src=", "<link", "@import", "url(", "href=\"http"] {
            assert!(!html.contains(loads), "{loads}");
        }
    }

    #[test]
    fn a_figure_without_a_title_is_read_out_by_its_caption() {
        let html = |title: &str| {
            let svg = XyPlot::new(title, Axis::linear("x", ""), Axis::linear("y", "")).with(
                "",
                &[0.0, 1.0],
                &[0.0, 1.0],
                Colour::MODEL,
                Mark::Line,
            );
            let mut page = page();
            page.sections = vec![Section::new("").figure(svg.to_svg().unwrap(), HOSTILE)];
            page.to_html().unwrap()
        };
        let named = html("");
        assert!(!named.contains("aria-label=\"\""), "{named}");
        assert!(named.contains("aria-label=\"&lt;script&gt;alert('1')"), "{named}");
        assert!(html("torque").contains("aria-label=\"torque\""));
    }

    #[test]
    fn warnings_are_on_the_page_where_there_are_any() {
        let page = || {
            let verdict =
                Verdict { status: Status::Bad, sentence: String::new(), facts: Vec::new() };
            Page::new("Diagnosis", "", verdict, Program::new(["armid"], None, Vec::new()))
        };
        let html = page().with_warnings(&["rows are missing".to_owned()]).to_html().unwrap();
        assert!(html.contains("<p class=\"note warn\">rows are missing</p>"), "{html}");
        assert!(page().with_warnings(&[]).sections.is_empty());
    }

    /// Facts that are folded stand behind those that are shown, in the banner.
    #[test]
    fn facts_can_be_folded() {
        let mut page = page();
        page.verdict.facts = vec!["shown".into()];
        page.folded = Some(Folded { title: "more".into(), facts: vec!["folded".into()] });
        let html = page.to_html().unwrap();
        let at = |text: &str| html.find(text).unwrap_or_else(|| panic!("{text} in {html}"));
        let order =
            ["<li>shown</li>", "<summary>more</summary>", "<li>folded</li>", "<nav"].map(at);
        assert!(order.is_sorted(), "{order:?}");
        page.folded = None;
        assert!(!page.to_html().unwrap().contains("folded"));
    }

    #[test]
    fn the_same_contents_give_the_same_bytes() {
        assert_eq!(page().to_html().unwrap(), page().to_html().unwrap());
    }

    #[test]
    fn the_verdict_comes_before_every_section_and_anchors_resolve() {
        let html = page().to_html().unwrap();
        let verdict = html.find("class=\"verdict warn\"").unwrap();
        assert!(verdict < html.find("<section").unwrap());
        for target in ["s1", "s2"] {
            assert!(
                html.contains(&format!("href=\"#{target}\""))
                    && html.contains(&format!("id=\"{target}\""))
            );
        }
    }
}
