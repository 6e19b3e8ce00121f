//! Edits to the text of an XML file that leave everything else as it is, byte for byte.

use std::ops::Range;

use roxmltree::Node;

/// Indentation step where the file does not show one.
const USUAL_STEP: &str = "  ";

/// Line end and indentation in front of an element and of its children; empty where all share one line.
#[derive(Default)]
pub(super) struct Margins {
    /// Of the element and of its closing tag.
    pub own: String,
    /// Of its children.
    pub inner: String,
}

impl Margins {
    fn of(own: Option<String>, step: &str) -> Self {
        own.map(|own| Self { inner: format!("{own}{step}"), own }).unwrap_or_default()
    }
}

/// A text and the changes to it.
pub(super) struct Edits<'t> {
    text: &'t str,
    /// Byte ranges and their replacements.
    changes: Vec<(Range<usize>, String)>,
}

impl<'t> Edits<'t> {
    pub(super) fn new(text: &'t str) -> Self {
        Self { text, changes: Vec::new() }
    }

    /// The text with all changes applied.
    pub(super) fn applied(mut self) -> String {
        // Applied from the back, so that the positions of earlier changes stay valid; of two insertions at one place,
        // the one that was made first ends up in front.
        self.changes.sort_by_key(|(range, _)| range.start);
        let mut text = self.text.to_owned();
        for (range, new) in self.changes.into_iter().rev() {
            text.replace_range(range, &new);
        }
        text
    }

    /// Replaces `element` by what `write` returns; an element on one line stays on one line.
    pub(super) fn replace(
        &mut self,
        element: Node<'_, '_>,
        write: impl FnOnce(&Margins) -> String,
    ) {
        let is_one_line = !self.text[element.range()].contains('\n');
        let own = margin(self.text, element).filter(|_| !is_one_line).map(str::to_owned);
        let margins = Margins::of(own, step(self.text, element));
        self.changes.push((element.range(), write(&margins)));
    }

    /// Inserts what `write` returns as the first child of `parent`.
    pub(super) fn put_first(
        &mut self,
        parent: Node<'_, '_>,
        write: impl FnOnce(&Margins) -> String,
    ) {
        let outer = margin(self.text, parent);
        let step = step(self.text, parent);
        let own = match parent.first_element_child() {
            Some(sibling) => margin(self.text, sibling).map(str::to_owned),
            None => outer.map(|outer| format!("{outer}{step}")),
        };
        let margins = Margins::of(own, step);
        let new = format!("{}{}", margins.own, write(&margins));
        if let Some(first) = parent.first_child() {
            let at = first.range().start;
            self.changes.push((at..at, new));
            return;
        }
        let Range { start, end } = parent.range();
        let whole = &self.text[start..end];
        let outer = outer.unwrap_or_default();
        self.changes.push(match whole.strip_suffix("/>") {
            Some(tag) => {
                let name = qualified_name(self.text, parent);
                let at = start + tag.trim_end().len();
                (at..end, format!(">{new}{outer}</{name}>"))
            }
            None => {
                let at = start + whole.rfind("</").unwrap_or(whole.len());
                (at..at, format!("{new}{outer}"))
            }
        });
    }

    /// Inserts the element `new` as the last child of `parent`.
    pub(super) fn put_last(&mut self, parent: Node<'_, '_>, new: String) {
        // Comments count as children: a comment on the line of another element belongs to that element.
        let Some(last) = parent.children().rfind(|node| !node.is_text()) else {
            return self.put_first(parent, |_| new);
        };
        let sibling = parent.last_element_child().unwrap_or(last);
        let margin = margin(self.text, sibling).unwrap_or_default();
        let at = last.range().end;
        self.changes.push((at..at, format!("{margin}{new}")));
    }

    /// Sets `attributes` of `element`. Its other attributes stay, and so does the way in which those that exist are
    /// written.
    pub(super) fn set_attributes(&mut self, element: Node<'_, '_>, attributes: &[(&str, String)]) {
        let at = match element.attributes().next_back() {
            Some(last) => last.range().end,
            None => element.range().start + 1 + qualified_name(self.text, element).len(),
        };
        for (name, value) in attributes {
            self.changes.push(match element.attribute_node(*name) {
                Some(attribute) => (attribute.range_value(), value.clone()),
                None => (at..at, format!(" {name}=\"{value}\"")),
            });
        }
    }

    /// Namespace prefix in the name of `element`, with its colon; empty without one.
    pub(super) fn prefix(&self, element: Node<'_, '_>) -> &'t str {
        let name = qualified_name(self.text, element);
        &name[..name.find(':').map_or(0, |colon| colon + 1)]
    }
}

/// The first child element of this name.
pub(super) fn child<'d, 'i>(element: Node<'d, 'i>, name: &str) -> Option<Node<'d, 'i>> {
    element.children().find(|node| node.has_tag_name(name))
}

/// Name of an element as written, with its prefix.
fn qualified_name<'t>(text: &'t str, element: Node<'_, '_>) -> &'t str {
    let behind = &text[element.range().start + 1..];
    let ends = |c: char| c.is_whitespace() || c == '/' || c == '>';
    &behind[..behind.find(ends).unwrap_or(behind.len())]
}

/// Line end and indentation in front of an element; `None` where it is not the first on its line.
fn margin<'t>(text: &'t str, element: Node<'_, '_>) -> Option<&'t str> {
    let before = &text[..element.range().start];
    let line = before.trim_end_matches([' ', '\t']);
    let line_end = ["\r\n", "\n"].into_iter().find(|end| line.ends_with(*end))?;
    Some(&before[line.len() - line_end.len()..])
}

/// Indentation of an element relative to its parent.
fn step<'t>(text: &'t str, element: Node<'_, '_>) -> &'t str {
    let own = margin(text, element).unwrap_or_default();
    let outer = element.parent_element().and_then(|parent| margin(text, parent));
    let step = own.strip_prefix(outer.unwrap_or_default()).unwrap_or_default();
    let step = step.trim_start_matches(['\r', '\n']);
    if step.is_empty() { USUAL_STEP } else { step }
}

#[cfg(test)]
mod tests {
    use roxmltree::Document;

    use super::*;

    fn edited(text: &str, edit: impl FnOnce(&mut Edits<'_>, Node<'_, '_>)) -> String {
        let document = Document::parse(text).unwrap();
        let mut edits = Edits::new(text);
        edit(&mut edits, document.root_element());
        edits.applied()
    }

    /// An element with a child.
    fn nested(margins: &Margins) -> String {
        format!("<n>{}<m/>{}</n>", margins.inner, margins.own)
    }

    fn put_first(text: &str) -> String {
        edited(text, |edits, root| edits.put_first(child(root, "link").unwrap(), nested))
    }

    #[test]
    fn what_is_put_first_stands_as_its_siblings_do() {
        let siblings = "<robot>\r\n\t<link name=\"a\">\r\n\t\t<v/>\r\n\t</link>\r\n</robot>";
        assert_eq!(
            put_first(siblings),
            "<robot>\r\n\t<link name=\"a\">\r\n\t\t<n>\r\n\t\t\t<m/>\r\n\t\t</n>\r\n\t\t<v/>\r\n\t</link>\r\n</robot>"
        );
        assert_eq!(put_first("<r><link><v/></link></r>"), "<r><link><n><m/></n><v/></link></r>");
        let comment = "<r>\n <link><!-- to do -->\n </link>\n</r>";
        let expected = "<r>\n <link>\n  <n>\n   <m/>\n  </n><!-- to do -->\n </link>\n</r>";
        assert_eq!(put_first(comment), expected);
    }

    #[test]
    fn an_element_without_anything_in_it_is_opened() {
        let expected = "<r>\n  <link>\n    <n>\n      <m/>\n    </n>\n  </link>\n</r>";
        for empty in ["<link/>", "<link />", "<link></link>"] {
            assert_eq!(put_first(&format!("<r>\n  {empty}\n</r>")), expected, "{empty}");
        }
        let named = "<u:r xmlns:u=\"x\"><u:link name=\"a/>b\" /></u:r>";
        let expected = "<u:r xmlns:u=\"x\"><u:link name=\"a/>b\"><n><m/></n></u:link></u:r>";
        assert_eq!(put_first(named), expected);
    }

    #[test]
    fn what_takes_the_place_of_one_line_is_one_line() {
        let replaced = |text: &str| {
            edited(text, |edits, root| edits.replace(child(root, "n").unwrap(), nested))
        };
        assert_eq!(replaced("<r>\n  <n><o/></n>\n</r>"), "<r>\n  <n><m/></n>\n</r>");
        assert_eq!(replaced("<r>\n  <n/>\n</r>"), "<r>\n  <n><m/></n>\n</r>");
        let lines = "<r>\r\n  <n>\r\n    <m/>\r\n  </n>\r\n</r>";
        assert_eq!(replaced(&lines.replace("<m/>", "<o/> <o/>")), lines);
    }

    #[test]
    fn what_is_put_last_stands_behind_the_comments() {
        let put = |text: &str| edited(text, |edits, root| edits.put_last(root, "<n/>".into()));
        assert_eq!(
            put("<j>\n  <a/> <!-- of a -->\n</j>"),
            "<j>\n  <a/> <!-- of a -->\n  <n/>\n</j>"
        );
        assert_eq!(put("<j><a/></j>"), "<j><a/><n/></j>");
        assert_eq!(put("<j/>"), "<j><n/></j>");
    }

    #[test]
    fn attributes_are_written_over_or_added() {
        let set = |text: &str| {
            let values = [("damping", "1.5".to_owned()), ("friction", "2".to_owned())];
            edited(text, |edits, root| edits.set_attributes(root, &values))
        };
        assert_eq!(set("<d friction = '0' damping=\"\"/>"), "<d friction = '2' damping=\"1.5\"/>");
        assert_eq!(set("<d damping='0'\n/>"), "<d damping='1.5' friction=\"2\"\n/>");
        assert_eq!(
            set("<d spring=\"7\"></d>"),
            "<d spring=\"7\" damping=\"1.5\" friction=\"2\"></d>"
        );
        assert_eq!(set("<d/>"), "<d damping=\"1.5\" friction=\"2\"/>");
    }

    #[test]
    fn names_are_known_with_their_prefix() {
        let prefix = |text: &str| {
            let document = Document::parse(text).unwrap();
            Edits::new(text).prefix(document.root_element()).to_owned()
        };
        assert_eq!(prefix("<u:link xmlns:u=\"x\"/>"), "u:");
        assert_eq!(prefix("<link xmlns=\"x\"/>"), "");
    }
}
