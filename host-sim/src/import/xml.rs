//! XML whose every refusal names file, line and element.

use roxmltree::{Attribute, Document, Node, ParsingOptions};

use crate::input_file::InputFileError;

/// Far more than a robot needs, and far less than would fill the memory.
const MOST_NODES: u32 = 100_000;

/// A file, for reading numbers out of it and for turning a place in it into a message.
pub(super) struct XmlFile<'a> {
    path: &'a str,
    document: Document<'a>,
}

impl<'a> XmlFile<'a> {
    /// Reads the text of a file.
    ///
    /// The files of CASPR have a document type, so that it has to be allowed; what it refers to is not fetched.
    /// Entities would be expanded, a small file to a huge one, and neither format has any: they are refused.
    pub(super) fn parse(text: &'a str, path: &'a str) -> Result<Self, InputFileError> {
        let content = |line, message: String| InputFileError::Content {
            path: path.to_owned(),
            line,
            field: "XML".to_owned(),
            message,
        };
        if let Some(place) = text.find("<!ENTITY") {
            let line = 1 + text[..place].matches('\n').count();
            return Err(content(
                line,
                "entities are not read, write out what they stand for".into(),
            ));
        }
        let options =
            ParsingOptions { allow_dtd: true, nodes_limit: MOST_NODES, entity_resolver: None };
        let document = Document::parse_with_options(text, options)
            .map_err(|error| content(error.pos().row as usize, error.to_string()))?;
        Ok(Self { path, document })
    }

    pub(super) fn path(&self) -> &'a str {
        self.path
    }

    pub(super) fn root(&self) -> Node<'_, 'a> {
        self.document.root_element()
    }

    pub(super) fn line(&self, node: Node<'_, '_>) -> usize {
        self.line_at(node.range().start)
    }

    fn line_at(&self, byte: usize) -> usize {
        self.document.text_pos_at(byte).row as usize
    }

    /// Refuses an element.
    pub(super) fn refuse(&self, node: Node<'_, '_>, message: impl Into<String>) -> InputFileError {
        self.content(self.line(node), place(node), message)
    }

    /// Refuses an attribute of an element.
    pub(super) fn refuse_attribute(
        &self,
        node: Node<'_, '_>,
        attribute: &Attribute<'_, '_>,
        message: impl Into<String>,
    ) -> InputFileError {
        let field = format!("{}, {}", place(node), attribute.name());
        self.content(self.line_at(attribute.range().start), field, message)
    }

    fn content(&self, line: usize, field: String, message: impl Into<String>) -> InputFileError {
        InputFileError::Content { path: self.path.to_owned(), line, field, message: message.into() }
    }

    /// The only element of this name inside another, if there is one.
    pub(super) fn optional<'d>(
        &self,
        node: Node<'d, 'a>,
        name: &str,
    ) -> Result<Option<Node<'d, 'a>>, InputFileError> {
        let mut found = elements(node).filter(|child| child.has_tag_name(name));
        let first = found.next();
        match found.next() {
            Some(second) => Err(self.refuse(second, "given twice")),
            None => Ok(first),
        }
    }

    /// The only element of this name inside another.
    pub(super) fn child<'d>(
        &self,
        node: Node<'d, 'a>,
        name: &str,
    ) -> Result<Node<'d, 'a>, InputFileError> {
        self.optional(node, name)?
            .ok_or_else(|| self.refuse(node, format!("<{name}> is missing in it")))
    }

    /// An attribute that has to be there.
    pub(super) fn attribute<'d>(
        &self,
        node: Node<'d, 'a>,
        name: &str,
    ) -> Result<Attribute<'d, 'a>, InputFileError> {
        attribute(node, name)
            .ok_or_else(|| self.refuse(node, format!("the attribute {name} is missing")))
    }

    /// The words inside an element.
    fn words<'d>(&self, node: Node<'d, 'a>) -> Result<Vec<&'d str>, InputFileError> {
        if let Some(child) = elements(node).next() {
            return Err(self.refuse(child, "only numbers are wanted here"));
        }
        // A comment in between cuts the text in two.
        let texts = node.children().filter(Node::is_text).filter_map(|child| child.text());
        Ok(texts.flat_map(str::split_whitespace).collect())
    }

    /// The number inside an element, possibly infinite.
    pub(super) fn limit(&self, node: Node<'_, 'a>) -> Result<f64, InputFileError> {
        let words = self.words(node)?;
        let &[word] = words.as_slice() else {
            return Err(self.refuse(node, format!("{} numbers given, one needed", words.len())));
        };
        number(word).map_err(|message| self.refuse(node, message))
    }

    /// The number inside an element.
    pub(super) fn number(&self, node: Node<'_, 'a>) -> Result<f64, InputFileError> {
        let value = self.limit(node)?;
        if value.is_finite() { Ok(value) } else { Err(self.refuse(node, "is not finite")) }
    }

    /// The three numbers inside an element.
    pub(super) fn vector(&self, node: Node<'_, 'a>) -> Result<[f64; 3], InputFileError> {
        let numbers: Result<Vec<f64>, String> = self.words(node)?.into_iter().map(finite).collect();
        let numbers = numbers.map_err(|message| self.refuse(node, message))?;
        numbers.try_into().map_err(|given: Vec<_>| {
            self.refuse(node, format!("{} numbers given, three needed", given.len()))
        })
    }

    /// The number in an attribute, if it is there.
    pub(super) fn optional_number_in(
        &self,
        node: Node<'_, 'a>,
        name: &str,
    ) -> Result<Option<f64>, InputFileError> {
        let Some(attribute) = attribute(node, name) else { return Ok(None) };
        finite(attribute.value().trim())
            .map(Some)
            .map_err(|message| self.refuse_attribute(node, &attribute, message))
    }

    /// The number in an attribute that has to be there.
    pub(super) fn number_in(&self, node: Node<'_, 'a>, name: &str) -> Result<f64, InputFileError> {
        self.attribute(node, name)?;
        Ok(self.optional_number_in(node, name)?.unwrap_or_default())
    }

    /// The vector in the attributes x, y and z.
    pub(super) fn vector_in(&self, node: Node<'_, 'a>) -> Result<[f64; 3], InputFileError> {
        Ok([self.number_in(node, "x")?, self.number_in(node, "y")?, self.number_in(node, "z")?])
    }

    /// Numbers in an attribute, separated by blanks.
    pub(super) fn numbers_in(
        &self,
        node: Node<'_, 'a>,
        attribute: &Attribute<'_, 'a>,
    ) -> Result<Vec<f64>, InputFileError> {
        let numbers: Result<Vec<f64>, String> =
            attribute.value().split_whitespace().map(finite).collect();
        numbers.map_err(|message| self.refuse_attribute(node, attribute, message))
    }
}

/// The elements directly inside another.
pub(super) fn elements<'d, 'a>(node: Node<'d, 'a>) -> impl Iterator<Item = Node<'d, 'a>> {
    node.children().filter(Node::is_element)
}

/// An attribute, with its place.
pub(super) fn attribute<'d, 'a>(node: Node<'d, 'a>, name: &str) -> Option<Attribute<'d, 'a>> {
    node.attributes().find(|attribute| attribute.name() == name)
}

/// Where an element is: `cables/cable_set/cable_ideal[3]`, counted from 1 where there are several of a name.
fn place(node: Node<'_, '_>) -> String {
    let mut names: Vec<String> = node
        .ancestors()
        .filter(Node::is_element)
        .map(|element| {
            let name = element.tag_name().name();
            let before = element.prev_siblings().skip(1).filter(|other| other.has_tag_name(name));
            let after = element.next_siblings().skip(1).any(|other| other.has_tag_name(name));
            match 1 + before.count() {
                1 if !after => name.to_owned(),
                number => format!("{name}[{number}]"),
            }
        })
        .collect();
    names.reverse();
    names.join("/")
}

fn number(word: &str) -> Result<f64, String> {
    match word.parse::<f64>() {
        Ok(value) if !value.is_nan() => Ok(value),
        _ => Err(format!("'{word}' is not a number")),
    }
}

fn finite(word: &str) -> Result<f64, String> {
    let value = number(word)?;
    if value.is_finite() { Ok(value) } else { Err("is not finite".to_owned()) }
}
