//! The suite that users run must be able to fail, each time for the right case.
