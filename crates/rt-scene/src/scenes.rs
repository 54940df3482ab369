//! The scenes that can be named without a file.

/// A built-in scene: the name a user gives and what it shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SceneEntry {
    /// The name, without the prefix `builtin:`.
    pub name: &'static str,
    /// One line that says what the scene is good for.
    pub description: &'static str,
}

/// Every built-in scene, in the order in which they are listed.
pub const SCENES: [SceneEntry; 2] = [
    SceneEntry {
        name: "yard",
        description: "a garden under an open sky: much grass and foliage in one part of the picture, little elsewhere",
    },
    SceneEntry { name: "car", description: "a car on a plain floor: finely tessellated, small in the picture" },
];

/// The entry called `name`, with or without the prefix `builtin:`.
#[must_use]
pub fn find(name: &str) -> Option<SceneEntry> {
    let name = name.strip_prefix("builtin:").unwrap_or(name);
    SCENES.into_iter().find(|entry| entry.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_are_found_by_their_names_and_nothing_else() {
        for entry in SCENES {
            assert_eq!(find(entry.name), Some(entry));
            assert_eq!(find(&format!("builtin:{}", entry.name)), Some(entry));
            assert!(!entry.description.contains('\n'));
        }
        assert_eq!(find("Yard"), None);
        assert_eq!(find(""), None);
    }
}
