//! The statements of an OBJ or MTL text: logical lines with the number of the physical line where they begin.

use std::borrow::Cow;

/// A line that is neither empty nor a comment, continuations joined.
#[derive(Clone, Debug)]
pub(super) struct Statement<'a> {
    /// Physical line where it begins, from 1.
    pub(super) line: u64,
    text: Cow<'a, [u8]>,
}

impl Statement<'_> {
    /// The first word.
    pub(super) fn keyword(&self) -> &[u8] {
        self.words().next().unwrap_or_default()
    }

    /// The words after the first, up to a trailing comment.
    pub(super) fn arguments(&self) -> impl Iterator<Item = &[u8]> {
        self.words().skip(1).take_while(|word| !word.starts_with(b"#"))
    }

    /// All that follows the first word: a name, which may hold spaces and `#`. Bytes that are not UTF-8 are taken for
    /// Latin-1, so that the same name is read alike in both files.
    pub(super) fn name(&self) -> String {
        let rest = self.text[self.keyword().len()..].trim_ascii();
        let name = match str::from_utf8(rest) {
            Ok(name) => name.to_owned(),
            Err(_) => rest.iter().map(|&byte| char::from(byte)).collect(),
        };
        // The parser trims all that Unicode calls white space, and refuses a name of nothing else.
        name.trim().to_owned()
    }

    fn words(&self) -> impl Iterator<Item = &[u8]> {
        self.text.split(|&byte| is_space(byte)).filter(|word| !word.is_empty())
    }
}

/// Blank, tabulators of both kinds, form feed, carriage return, line feed.
fn is_space(byte: u8) -> bool {
    byte == b' ' || (9..=13).contains(&byte)
}

/// Iterator over the statements of a text.
#[derive(Clone, Debug)]
pub(super) struct Statements<'a> {
    rest: &'a [u8],
    line: u64,
}

impl<'a> Statements<'a> {
    /// All statements of `bytes`, a leading UTF-8 byte order mark left out.
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes), line: 0 }
    }

    /// Number of bytes not yet looked at.
    pub(super) fn remaining(&self) -> u64 {
        self.rest.len() as u64
    }

    /// The next physical line, spaces around it left out.
    fn physical_line(&mut self) -> Option<&'a [u8]> {
        if self.rest.is_empty() {
            return None;
        }
        self.line += 1;
        let end = self.rest.iter().position(|&byte| byte == b'\n');
        let (line, rest) = end.map_or((self.rest, &[][..]), |end| (&self.rest[..end], &self.rest[end + 1..]));
        self.rest = rest;
        Some(trim(line))
    }
}

/// `text` without spaces at either end.
fn trim(mut text: &[u8]) -> &[u8] {
    while let [first, rest @ ..] = text
        && is_space(*first)
    {
        text = rest;
    }
    while let [rest @ .., last] = text
        && is_space(*last)
    {
        text = rest;
    }
    text
}

impl<'a> Iterator for Statements<'a> {
    type Item = Statement<'a>;

    fn next(&mut self) -> Option<Statement<'a>> {
        loop {
            let first = self.physical_line()?;
            let line = self.line;
            // A comment that ends in a backslash (a Windows path, say) does not swallow the line below.
            if first.is_empty() || first[0] == b'#' {
                continue;
            }
            if !first.ends_with(b"\\") {
                return Some(Statement { line, text: Cow::Borrowed(first) });
            }
            let mut joined = first.to_vec();
            while joined.last() == Some(&b'\\') {
                joined.pop();
                joined.push(b' ');
                joined.extend_from_slice(self.physical_line().unwrap_or_default());
            }
            // Continuations alone join to nothing.
            let text = trim(&joined);
            if text.is_empty() {
                continue;
            }
            return Some(Statement { line, text: Cow::Owned(text.to_vec()) });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(text: &[u8]) -> Vec<(u64, String, Vec<String>)> {
        let text_of = |word: &[u8]| String::from_utf8_lossy(word).into_owned();
        Statements::new(text).map(|s| (s.line, text_of(s.keyword()), s.arguments().map(text_of).collect())).collect()
    }

    #[test]
    fn lines_are_numbered_joined_and_trimmed() {
        let text = b"\xef\xbb\xbf# caf\xe9 C:\\\r\n\r\n  v 1 \\\r\n 2\\\n3 # four\nf\t1 2\x0b3\n\\\n\\";
        let expected = [(3, "v", vec!["1", "2", "3"]), (6, "f", vec!["1", "2", "3"])];
        let expected: Vec<_> = expected
            .into_iter()
            .map(|(line, word, rest)| (line, word.to_owned(), rest.into_iter().map(str::to_owned).collect::<Vec<_>>()))
            .collect();
        assert_eq!(all(text), expected);
    }

    #[test]
    fn names_keep_spaces_and_signs_and_latin_letters() {
        let name = |text| Statements::new(text).next().unwrap().name();
        assert_eq!(name(b"usemtl\tColor #1  \n"), "Color #1");
        assert_eq!(name("usemtl gr\u{fc}n".as_bytes()), "gr\u{fc}n");
        assert_eq!(name(b"usemtl gr\xfcn"), "gr\u{fc}n");
        assert_eq!(name(b"usemtl"), "");
    }
}
