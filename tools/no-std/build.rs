//! Links without start files and default libraries, so that nothing but core, alloc and this package can answer a
//! symbol. Here and not in a configuration file: link arguments there would reach every package built from this folder.

fn main() {
    // "-no-pie": a position-independent program would need someone to relocate its tables of functions at start.
    for argument in ["-nostartfiles", "-nodefaultlibs", "-static", "-no-pie"] {
        println!("cargo::rustc-link-arg-bins={argument}");
    }
    println!("cargo::rerun-if-changed=build.rs");
}
