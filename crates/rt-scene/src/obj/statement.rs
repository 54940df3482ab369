//! The statements of an OBJ or MTL text: logical lines with the number of the physical line where they begin.

use memchr::memchr2;
use std::borrow::Cow;

/// A line that is neither empty nor a comment, with the lines that continue it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Statement<'a> {
    /// Physical line where it begins, from 1.
    pub(super) line: u64,
    text: &'a [u8],
}

impl<'a> Statement<'a> {
    /// The first word.
    pub(super) fn keyword(&self) -> &'a [u8] {
        self.words().next().unwrap_or_default()
    }

    /// The words after the first, up to a comment.
    pub(super) fn arguments(&self) -> impl Iterator<Item = &'a [u8]> + use<'a> {
        let mut words = self.words();
        words.next();
        let mut in_comment = false;
        words.map_while(move |word| {
            if in_comment {
                return None;
            }
            let end = comment(word).unwrap_or(word.len());
            in_comment = end < word.len();
            (end > 0).then_some(&word[..end])
        })
    }

    /// All that follows the first word: a name, which may hold spaces and `#`.
    pub(super) fn name(&self) -> Name<'a> {
        let mut words = self.words();
        words.next();
        Name(trim(words.rest))
    }

    fn words(&self) -> Words<'a> {
        Words { rest: self.text }
    }
}

/// A name as it stands in a text.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Name<'a>(&'a [u8]);

impl<'a> Name<'a> {
    pub(super) const fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The name's characters. Bytes that are not UTF-8 are taken for Latin-1, so that the same name is read alike in
    /// files of both.
    pub(super) fn text(&self) -> Cow<'a, str> {
        let characters = |bytes: &[u8]| match str::from_utf8(bytes) {
            Ok(name) => name.trim().to_owned(),
            Err(_) => bytes.iter().map(|&byte| char::from(byte)).collect::<String>().trim().to_owned(),
        };
        if memchr2(b'\n', b'\r', self.0).is_some() {
            return characters(&Words { rest: self.0 }.collect::<Vec<_>>().join(&b' ')).into();
        }
        str::from_utf8(self.0).map_or_else(|_| characters(self.0).into(), |name| name.trim().into())
    }
}

/// Where a comment begins within a word. What Microsoft's libraries print for "not a number" begins with `1.#`.
fn comment(word: &[u8]) -> Option<usize> {
    let sign = word.iter().position(|&byte| byte == b'#')?;
    (!word[..sign].ends_with(b"1.")).then_some(sign)
}

/// Blank, tabulators of both kinds, form feed, carriage return, line feed.
const fn is_space(byte: u8) -> bool {
    byte == b' ' || matches!(byte, 9..=13)
}

/// The words of a logical line; a backslash at the end of a physical line stands for a space.
#[derive(Clone, Debug)]
struct Words<'a> {
    rest: &'a [u8],
}

impl<'a> Iterator for Words<'a> {
    type Item = &'a [u8];

    #[inline]
    fn next(&mut self) -> Option<&'a [u8]> {
        let mut rest = self.rest;
        while let [first, tail @ ..] = rest
            && (is_space(*first) || *first == b'\\' && ends_line(tail))
        {
            rest = tail;
        }
        let ends = |(i, &byte): (usize, &u8)| is_space(byte) || byte == b'\\' && ends_line(&rest[i + 1..]);
        let end = rest.iter().enumerate().position(ends).unwrap_or(rest.len());
        let word;
        (word, self.rest) = rest.split_at(end);
        (!word.is_empty()).then_some(word)
    }
}

/// Whether nothing but blanks follows up to the end of the line.
fn ends_line(text: &[u8]) -> bool {
    let next = text.iter().find(|byte| !matches!(byte, b' ' | b'\t' | 0x0b | 0x0c));
    matches!(next, None | Some(b'\r' | b'\n'))
}

/// Iterator over the statements of a text.
#[derive(Clone, Debug)]
pub(super) struct Statements<'a> {
    rest: &'a [u8],
    line: u64,
}

impl<'a> Statements<'a> {
    /// All statements of `text`.
    pub(super) fn new(text: &'a [u8]) -> Self {
        Self { rest: text, line: 0 }
    }

    /// Number of bytes not yet looked at.
    pub(super) fn remaining(&self) -> u64 {
        self.rest.len() as u64
    }

    /// The next physical line without the spaces around it. It ends in a line feed, a carriage return (as on the old
    /// Macintosh), or both.
    fn physical_line(&mut self) -> Option<&'a [u8]> {
        if self.rest.is_empty() {
            return None;
        }
        self.line += 1;
        let end = memchr2(b'\n', b'\r', self.rest).unwrap_or(self.rest.len());
        let (line, rest) = self.rest.split_at(end);
        self.rest = match rest {
            [b'\r', b'\n', rest @ ..] | [_, rest @ ..] => rest,
            [] => rest,
        };
        Some(trim(line))
    }
}

/// `text` without spaces at either end, and without the byte order marks that stand where files were joined.
fn trim(mut text: &[u8]) -> &[u8] {
    loop {
        text = text.trim_ascii_start();
        match text {
            [0x0b, rest @ ..] | [0xef, 0xbb, 0xbf, rest @ ..] => text = rest,
            _ => break,
        }
    }
    while let [rest @ .., last] = text
        && is_space(*last)
    {
        text = rest;
    }
    text
}

/// Whether the next line continues this one. A comment that ends in a backslash (a Windows path, say) does not swallow
/// the line below.
fn is_continued(line: &[u8]) -> bool {
    line.ends_with(b"\\") && !(Words { rest: line }).any(|word| comment(word) == Some(0))
}

impl<'a> Iterator for Statements<'a> {
    type Item = Statement<'a>;

    #[inline]
    fn next(&mut self) -> Option<Statement<'a>> {
        loop {
            let start = self.rest;
            let mut last = self.physical_line()?;
            let line = self.line;
            if last.is_empty() || last[0] == b'#' {
                continue;
            }
            if !is_continued(last) {
                return Some(Statement { line, text: last });
            }
            while is_continued(last)
                && let Some(next) = self.physical_line()
            {
                last = next;
            }
            let statement = Statement { line, text: trim(&start[..start.len() - self.rest.len()]) };
            // Continuations alone say nothing.
            if !statement.keyword().is_empty() {
                return Some(statement);
            }
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

    fn expect(text: &[u8], expected: &[(u64, &str, &[&str])]) {
        let expected: Vec<_> = expected
            .iter()
            .map(|&(line, word, rest)| (line, word.to_owned(), rest.iter().map(|&r| r.to_owned()).collect::<Vec<_>>()))
            .collect();
        assert_eq!(all(text), expected, "{}", String::from_utf8_lossy(text));
    }

    #[test]
    fn lines_are_numbered_joined_and_trimmed() {
        let text = b"\xef\xbb\xbf# caf\xe9 C:\\\r\n\r\n  v 1 \\\r\n 2\\\n3 # four\nf\t1 2\x0b3\n\\\n\\";
        expect(text, &[(3, "v", &["1", "2", "3"]), (6, "f", &["1", "2", "3"])]);
        expect(b"v 1 \\  \r2\\\r\n\t3\\", &[(1, "v", &["1", "2", "3"])]);
        expect(b"v 1 \\\n\n 2", &[(1, "v", &["1"]), (3, "2", &[])]);
    }

    #[test]
    fn lines_end_as_anybody_ends_them() {
        for end in ["\n", "\r\n", "\r"] {
            let text = ["v 1", "", "f 1 \\", "2", "g"].join(end);
            expect(text.as_bytes(), &[(1, "v", &["1"]), (3, "f", &["1", "2"]), (5, "g", &[])]);
        }
        expect(b"a\rb\nc\r\nd", &[(1, "a", &[]), (2, "b", &[]), (3, "c", &[]), (4, "d", &[])]);
        expect(b"a\n\xef\xbb\xbfb", &[(1, "a", &[]), (2, "b", &[])]);
    }

    #[test]
    fn comments_end_statements_and_swallow_nothing() {
        expect(b"v 1 2 # C:\\\nv 3\n", &[(1, "v", &["1", "2"]), (2, "v", &["3"])]);
        expect(
            b"v 1 2#3 4\nv #\nv -1.#IND 1.#QNAN#",
            &[(1, "v", &["1", "2"]), (2, "v", &[]), (3, "v", &["-1.#IND", "1.#QNAN#"])],
        );
        expect(b"f 1 \\\n#2 \\\nf 3", &[(1, "f", &["1"]), (3, "f", &["3"])]);
    }

    #[test]
    fn names_keep_spaces_and_signs_and_latin_letters() {
        let name = |text| Statements::new(text).next().unwrap().name().text();
        assert_eq!(name(b"usemtl\tColor #1  \n"), "Color #1");
        assert_eq!(name("usemtl gr\u{fc}n".as_bytes()), "gr\u{fc}n");
        assert_eq!(name(b"usemtl gr\xfcn"), "gr\u{fc}n");
        assert_eq!(name(b"usemtl"), "");
        assert_eq!(name(b"mtllib lib\\a.mtl \\\r\n b.mtl"), "lib\\a.mtl b.mtl");
    }
}
