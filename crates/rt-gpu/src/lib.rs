//! The host's side of a GPU launch.
