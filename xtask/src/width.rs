//! The width of lines that rustfmt does not break.

use crate::command::root;
use crate::files::entries;
use anyhow::{Context, Result, bail};
use std::fs;
use std::path::{Path, PathBuf};

/// Lines of comments and pages are no wider than those of code, which rustfmt sees to. Tables and what is quoted as
/// code cannot be broken; nor can a line that one address or code span fills.
pub(crate) fn check() -> Result<()> {
    let settings = read(&root().join("rustfmt.toml"))?;
    let width = settings.lines().find_map(|line| line.strip_prefix("max_width = ")?.parse().ok());
    let width: usize = width.context("rustfmt.toml states no `max_width`")?;
    let mut wide = Vec::new();
    for file in files(root(), &[".md", ".rs", ".wgsl"])? {
        let is_page = file.extension().is_some_and(|extension| extension == "md");
        let name = file.strip_prefix(root()).unwrap_or(&file).display();
        wide.extend(wide_lines(&read(&file)?, is_page, width).into_iter().map(|number| format!("{name}:{number}")));
    }
    if !wide.is_empty() {
        bail!("comments and pages have at most {width} columns; break {}", wide.join(", "));
    }
    Ok(())
}

/// Numbers of the lines of a page or of a program that are too wide.
fn wide_lines(text: &str, is_page: bool, width: usize) -> Vec<usize> {
    let is_long = |line: &str| line.chars().count() > width && words(line).all(|word| word.chars().count() < width / 2);
    let mut is_quoted = false;
    let mut wide = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        let comment = line.trim_start().strip_prefix("//");
        let text = comment.unwrap_or(line).trim_start_matches(['/', '!']).trim_start();
        if is_page && text.starts_with("```") {
            is_quoted = !is_quoted;
        }
        if (is_page || comment.is_some()) && !is_quoted && !text.starts_with('|') && is_long(line) {
            wide.push(number);
        }
    }
    wide
}

/// The words of a line, code spans whole.
fn words(line: &str) -> impl Iterator<Item = &str> {
    let mut is_code = false;
    line.split(move |character| {
        is_code ^= character == '`';
        character == ' ' && !is_code
    })
}

fn read(file: &Path) -> Result<String> {
    fs::read_to_string(file).with_context(|| format!("cannot read `{}`", file.display()))
}

/// The repository's own files below a folder.
fn files(folder: &Path, endings: &[&str]) -> Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for path in entries(folder)? {
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        if path.is_dir() {
            if !name.starts_with('.') && !["target", "out"].contains(&name) {
                found.extend(files(&path, endings)?);
            }
        } else if endings.iter().any(|ending| name.ends_with(ending)) {
            found.push(path);
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mutants: code looked at, tables, quotations or addresses not left out, pages taken for programs.
    #[test]
    fn what_can_be_broken_is_too_wide() {
        let long = "eleven words that can be broken";
        let address = "see https://example.com/a/very/long/path";
        let page = format!("{long}\nshort\n| {long} |\n```\n{long}\n```\n{address}\n{long}\n");
        assert_eq!(wide_lines(&page, true, 20), [1, 8]);
        let program = format!("    /// {long}\nlet code = \"{long}\";\n//! {long}\n// `{long}`\n");
        assert_eq!(wide_lines(&program, false, 20), [1, 3]);
    }
}
