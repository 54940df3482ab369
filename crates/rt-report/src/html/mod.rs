//! `report.html`: one page without network that shows what a command found.
//!
//! The template, its style and its script lie beside this file. Everything a page needs is inside it, and a content
//! security policy forbids the browser to fetch anything else.

mod cost_map;
pub mod measured;
pub mod render;

use crate::image::{self, Preview};
use crate::output::write_atomically;
use crate::table::{self, Table};
use crate::{Provenance, ReportError};
use std::fmt::Write as _;
use std::path::Path;

const TEMPLATE: &str = include_str!("page.html");
const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// Most pixels of a picture that a page embeds as they are. So a page stays below [`LARGEST`] bytes, whatever is
/// rendered.
pub const MOST_PIXELS: u32 = 1 << 20;

/// Most bytes of a page: a picture that does not compress takes 4 MB of base 64, the cost of each task as much.
pub const LARGEST: usize = 10 << 20;

/// A page in the making.
#[derive(Debug)]
pub struct Page {
    title: String,
    provenance: Provenance,
    seeds: String,
    /// Identifier and heading of each section.
    sections: Vec<(String, String)>,
    body: String,
}

impl Page {
    /// An empty page; `seeds` says in a sentence what random numbers were used.
    #[must_use]
    pub fn new(title: &str, provenance: &Provenance, seeds: &str) -> Self {
        Self {
            title: title.to_owned(),
            provenance: provenance.clone(),
            seeds: seeds.to_owned(),
            sections: Vec::new(),
            body: String::new(),
        }
    }

    /// Begins a section; what is added later belongs to it.
    pub fn section(&mut self, heading: &str) {
        let id = format!("section-{}", self.sections.len() + 1);
        let _ = writeln!(self.body, "<h2 id=\"{id}\">{}</h2>", escaped(heading));
        self.sections.push((id, heading.to_owned()));
    }

    /// Adds a paragraph.
    pub fn paragraph(&mut self, text: &str) {
        let _ = writeln!(self.body, "<p>{}</p>", escaped(text));
    }

    /// Adds what matters most, in a sentence that nobody overlooks.
    pub fn lead(&mut self, text: &str) {
        let _ = writeln!(self.body, "<p class=\"lead\">{}</p>", escaped(text));
    }

    /// Adds a chart; `alt` says what it shows to those who cannot see it.
    pub fn chart(&mut self, svg: &str, alt: &str, caption: &str) {
        let (alt, caption) = (escaped(alt), escaped(caption));
        // A role and a name make a picture of what a screen reader would spell out number by number. The scrolled box
        // can be reached by keyboard.
        let svg = svg.replacen("<svg ", &format!("<svg role=\"img\" aria-label=\"{alt}\" "), 1);
        let _ = writeln!(
            self.body,
            "<figure><div class=\"chart\" tabindex=\"0\" role=\"group\" aria-label=\"{alt}\">{svg}</div>\
             <figcaption>{caption}</figcaption></figure>"
        );
    }

    /// Adds a picture from its file, which lies beside the page: all of it, or scaled down where it has more than
    /// [`MOST_PIXELS`].
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn picture(&mut self, file: &Path, alt: &str) -> Result<(), ReportError> {
        let Preview { png, one_in } = image::preview(file, MOST_PIXELS)?;
        let _ =
            write!(self.body, "<figure><img alt=\"{}\" src=\"data:image/png;base64,{}\">", escaped(alt), base64(&png));
        if one_in > 1 {
            let name = escaped(&file.file_name().unwrap_or_default().to_string_lossy());
            let _ = write!(
                self.body,
                "<figcaption>Scaled to 1/{one_in}, to keep this page small. All pixels: \
                 <a href=\"{name}\">{name}</a></figcaption>"
            );
        }
        let _ = writeln!(self.body, "</figure>");
        Ok(())
    }

    /// Adds a list of files that lie beside the page, each with what it holds.
    pub fn files(&mut self, files: &[(&str, &str)]) {
        self.body.push_str("<ul>");
        for (name, what) in files {
            let (name, what) = (escaped(name), escaped(what));
            let _ = write!(self.body, "<li><a href=\"{name}\">{name}</a>: {what}</li>");
        }
        self.body.push_str("</ul>\n");
    }

    /// Adds text as one types it.
    pub fn code(&mut self, text: &str) {
        let _ = writeln!(self.body, "<p><code>{}</code></p>", escaped(text));
    }

    /// Adds a table.
    pub fn table(&mut self, caption: &str, table: &Table) {
        let _ = write!(
            self.body,
            "<div class=\"table\" tabindex=\"0\" role=\"group\" aria-label=\"{}\"><table>",
            escaped(caption)
        );
        let _ = write!(self.body, "<caption>{}</caption><thead>", escaped(caption));
        let class = |column: usize| if table.is_words(column) { " class=\"words\"" } else { "" };
        for (index, row) in table.rows().iter().enumerate() {
            let _ = write!(self.body, "<tr>");
            for (column, cell) in row.iter().enumerate() {
                let meaning = table::meaning(cell).filter(|_| index == 0);
                let title = meaning.map_or_else(String::new, |text| format!(" title=\"{}\"", escaped(text)));
                let (tag, scope) = if index == 0 { ("th", " scope=\"col\"") } else { ("td", "") };
                let _ = write!(self.body, "<{tag}{scope}{title}{}>{}</{tag}>", class(column), escaped(cell));
            }
            let _ = writeln!(self.body, "</tr>{}", if index == 0 { "</thead><tbody>" } else { "" });
        }
        let _ = writeln!(self.body, "</tbody></table></div>");
    }

    /// Adds a table so long that it is shown on request.
    pub fn folded_table(&mut self, caption: &str, table: &Table) {
        let _ = writeln!(self.body, "<details><summary>{}</summary>", escaped(caption));
        self.table(caption, table);
        let _ = writeln!(self.body, "</details>");
    }

    /// Adds markup that is right already.
    fn markup(&mut self, markup: &str) {
        self.body.push_str(markup);
    }

    /// The whole page.
    #[must_use]
    pub fn to_html(&self) -> String {
        let link = |(id, heading): &(String, String)| format!("<a href=\"#{id}\">{}</a> ", escaped(heading));
        let value = |name: &str| match name {
            "TITLE" => escaped(&self.title),
            "COMMAND" => escaped(&self.provenance.command),
            "COMMIT" => escaped(self.provenance.commit),
            "DATE" => escaped(&self.provenance.date),
            "MACHINE" => escaped(&self.provenance.machine.to_string()),
            "DEVICES" => escaped(&self.provenance.devices.join("; ")),
            "SEEDS" => escaped(&self.seeds),
            "NAVIGATION" => self.sections.iter().map(link).collect(),
            "STYLE" => STYLE.to_owned(),
            "SCRIPT" => SCRIPT.to_owned(),
            "BODY" => self.body.clone(),
            _ => String::new(),
        };
        // Piece by piece, so that nothing that was filled in is taken for a place of the template.
        let mut pieces = TEMPLATE.split("{{");
        let mut page = pieces.next().unwrap_or_default().to_owned();
        for piece in pieces {
            let (name, rest) = piece.split_once("}}").unwrap_or(("", piece));
            page.push_str(&value(name));
            page.push_str(rest);
        }
        page
    }

    /// Writes the page.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), ReportError> {
        let html = self.to_html();
        write_atomically(path, |out| out.write_all(html.as_bytes()))
    }
}

/// Text as it stands in HTML and SVG, in attributes too.
pub(crate) fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c => out.push(c),
        }
    }
    out
}

/// Bytes in the alphabet of RFC 4648, section 4.
fn base64(bytes: &[u8]) -> String {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let byte = |i: usize| u32::from(three.get(i).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        for digit in 0..4 {
            let there = digit <= three.len();
            out.push(if there { char::from(ALPHABET[(bits >> (18 - 6 * digit) & 63) as usize]) } else { '=' });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn page(title: &str) -> Page {
        Page::new(title, &Provenance::now(1, ["a <device>"]), "Seed 1.")
    }

    /// The examples of RFC 4648, section 10.
    #[test]
    fn base64_is_as_in_the_standard() {
        for (text, code) in
            [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foob", "Zm9vYg=="), ("foobar", "Zm9vYmFy")]
        {
            assert_eq!(base64(text.as_bytes()), code);
        }
        assert_eq!(base64(&[0xfb, 0xff]), "+/8=");
    }

    // Mutants: `escaped` left out of the title; the template filled by `replace`, in which order counts.
    #[test]
    fn whatever_is_filled_in_stays_text() {
        let mut page = page("</title><script>alert(1)</script> {{BODY}}");
        page.section("{{STYLE}} & \"more\"");
        page.paragraph("<b>");
        let html = page.to_html();
        assert!(!html.contains("<script>alert") && !html.contains("<b>"));
        assert!(html.contains("{{BODY}}</h1>") && html.contains("{{STYLE}} &amp; &quot;more&quot;"));
        assert_eq!(html.matches("color-scheme: dark").count(), 1);
    }

    #[test]
    fn every_place_of_the_template_is_filled_and_nothing_comes_from_outside() {
        let mut page = page("t");
        page.chart("<svg xmlns=\"x\"></svg>", "a \"chart\"", "c");
        let mut table = Table::new(&["word", "number"]);
        table.row(vec!["a".to_owned(), "1".to_owned()]);
        page.table("t", &table);
        let html = page.to_html();
        assert!(!html.contains("{{") && !html.contains("http:") && !html.contains("https:"));
        assert!(html.contains("<svg role=\"img\" aria-label=\"a &quot;chart&quot;\" xmlns"));
        assert!(html.contains("<td class=\"words\">a</td><td>1</td>"));
        let Provenance { commit, date, .. } = &page.provenance;
        assert!(html.contains(&format!("commit {commit}, <time>{date}</time>")) && html.contains("a &lt;device&gt;"));
    }

    /// A chart's grey that the style does not know would be unreadable in the dark.
    #[test]
    fn the_style_turns_over_every_grey_of_the_charts() {
        for grey in crate::chart::GREYS {
            let name = format!("fill=\"#{:02X}{:02X}{:02X}\"", grey[0], grey[1], grey[2]);
            assert!(STYLE.contains(&name), "{name}");
        }
    }
}
