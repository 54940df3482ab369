//! Compiles the WGSL kernels to SPIR-V and writes a table of them.
#![expect(clippy::print_stdout, reason = "so cargo is told what to watch")]

mod spirv;

use naga::back::spv;
use naga::valid::{Capabilities, ValidationFlags, Validator};
use std::error::Error;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs};

/// What keeps rounded results as they are: in the SPIR-V, and in the WGSL for APIs that compile it themselves.
const KEEP: [&str; 2] = ["keep_decorated.wgsl", "keep_hidden.wgsl"];

/// What every kernel reads that traces, or pretends to; after them come its rays.
const GIVEN: &[&str] = &["bindings.wgsl", "ray.wgsl", "ray_list.wgsl"];

/// The rays, and those that tell in tests how often they were visited.
const RAYS: [&str; 2] = ["rays.wgsl", "rays_visited.wgsl"];

/// The other parts of every kernel that traces, in order; after them comes the loop over its layout.
const PARTS: &[&str] = &["launch.wgsl", "double_float.wgsl", "slabs.wgsl", "triangle.wgsl", "leaf.wgsl"];

/// The layouts of trees: name in Rust, the loop, and sizes of the traversal stack.
///
/// Two-wide trees of real scenes need some 30 to 50 entries, wide ones 8 to 20; 128 is the most a scene may need.
const TREES: &[(&str, &str, &[u32])] =
    &[("Two", "traverse.wgsl", &[32, 64, 128]), ("Wide", "wide.wgsl", &[16, 32, 128])];

/// The other parts of kernels that make rays: name in Rust, and the parts.
const MAKERS: &[(&str, &[&str])] = &[
    ("Camera", &["ray.wgsl", "double_float.wgsl", "random.wgsl", "prepare.wgsl", "ray_recipe.wgsl", "camera.wgsl"]),
    ("Bounce", &["ray.wgsl", "double_float.wgsl", "random.wgsl", "prepare.wgsl", "ray_recipe.wgsl", "bounce.wgsl"]),
];

/// The other parts of the kernel by which devices are checked.
const ARITHMETIC: &[&str] = &["double_float.wgsl", "arithmetic.wgsl"];

/// What kernels are for: name in Rust, and the constants that the sources ask for.
const PURPOSES: &[(&str, Flags)] = &[
    ("Closest", Flags { any: false, count: false, reduced: false, cut: false }),
    ("ClosestCounted", Flags { any: false, count: true, reduced: false, cut: false }),
    ("Any", Flags { any: true, count: false, reduced: false, cut: false }),
    ("AnyCounted", Flags { any: true, count: true, reduced: false, cut: false }),
    ("LeafAsHit", Flags { any: false, count: true, reduced: true, cut: true }),
    ("Unshortened", Flags { any: false, count: true, reduced: true, cut: false }),
];

/// Kernels for tests that trace as another one does: name in Rust, and the one of [`PURPOSES`].
const VISITING: &[(&str, &str)] = &[("Visiting", "Closest"), ("VisitingCounted", "ClosestCounted")];

/// Kernels for tests that trace nothing: name in Rust, which of [`RAYS`], and the rest.
const PRETENDING: &[(&str, usize, &str)] = &[
    ("Visits", 1, "visits.wgsl"),
    ("Poisoned", 0, "faulty/poisoned.wgsl"),
    ("Slow", 0, "faulty/slow.wgsl"),
    ("TooWide", 0, "faulty/too_wide.wgsl"),
];

/// Structures whose layout the crate's tests compare with those of the host.
const LAYOUTS: &[&str] = &["Node", "WideNode", "Triangle", "Ray", "VisitedRay", "Frame", "RayList", "Camera", "Bounce"];

struct Flags {
    any: bool,
    count: bool,
    reduced: bool,
    cut: bool,
}

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed=shaders");
    println!("cargo::rerun-if-changed=build");
    let target = PathBuf::from(env::var_os("OUT_DIR").ok_or("cargo sets OUT_DIR")?);
    let mut kernels = String::from("pub(crate) static KERNELS: &[Kernel] = &[\n");
    let mut modules = Vec::new();
    for (tree, walk, stacks) in TREES {
        let [bodies, visiting] = RAYS.map(|rays| joined(&[GIVEN, &[rays], PARTS, &[*walk]].concat()));
        let (bodies, visiting) = (bodies?, visiting?);
        for (purpose, flags) in PURPOSES {
            for &stack in *stacks {
                let sources = with_preamble(flags, stack, &bodies);
                modules.push(add(&mut kernels, &target, [tree, purpose], stack, &sources)?);
            }
            // The deepest stack will do for tests.
            for ((name, _), stack) in VISITING.iter().filter(|(_, of)| of == purpose).zip(stacks.last()) {
                let sources = with_preamble(flags, *stack, &visiting);
                modules.push(add(&mut kernels, &target, [tree, name], *stack, &sources)?);
            }
        }
    }
    for (purpose, parts) in MAKERS {
        modules.push(add(&mut kernels, &target, ["Two", purpose], 0, &joined(parts)?)?);
    }
    add(&mut kernels, &target, ["Two", "Arithmetic"], 0, &joined(ARITHMETIC)?)?;
    for (purpose, rays, rest) in PRETENDING {
        // They trace nothing, so that one will do for trees of any layout and depth.
        let sources = joined(&[GIVEN, &[RAYS[*rays], *rest]].concat())?;
        add(&mut kernels, &target, ["Two", purpose], u32::MAX, &sources)?;
    }
    kernels += "];\n";
    fs::write(target.join("kernels.rs"), kernels + &layout_table(&modules)?)?;
    Ok(())
}

/// The parts behind each of [`KEEP`].
fn joined(parts: &[&str]) -> std::io::Result<[String; 2]> {
    let join = |keep| {
        let files = std::iter::once(&keep).chain(parts);
        files.map(|part| fs::read_to_string(Path::new("shaders").join(part))).collect::<std::io::Result<String>>()
    };
    let [decorated, hidden] = KEEP;
    Ok([join(decorated)?, join(hidden)?])
}

/// Compiles a kernel, of which `sources` are the variants of [`KEEP`], writes the SPIR-V of the first and the WGSL of
/// the second to `target`, and the row to the table.
fn add(
    table: &mut String,
    target: &Path,
    [tree, purpose]: [&str; 2],
    stack: u32,
    [decorated, hidden]: &[String; 2],
) -> Result<naga::Module, Box<dyn Error>> {
    let failed = |e| format!("{tree}, {purpose}, stack of {stack}: {e}");
    let (module, words) = compile(decorated).map_err(failed)?;
    // Only to see that it can be.
    compile(hidden).map_err(failed)?;
    let file = format!("{tree}-{purpose}-{stack}");
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    fs::write(target.join(&file).with_extension("spv"), bytes)?;
    fs::write(target.join(&file).with_extension("wgsl"), hidden)?;
    let entry = &module.entry_points[0];
    writeln!(
        table,
        "    Kernel {{ layout: Layout::{tree}, purpose: Purpose::{purpose}, stack: {stack}, entry: c{:?}, workgroup: {:?}, \
         bindings: &[{}], code: include_bytes!(concat!(env!(\"OUT_DIR\"), \"/{file}.spv\")), \
         wgsl: include_str!(concat!(env!(\"OUT_DIR\"), \"/{file}.wgsl\")) }},",
        entry.name,
        entry.workgroup_size,
        bindings(&module)?
    )?;
    Ok(module)
}

/// The sources behind the constants that they ask for.
fn with_preamble(flags: &Flags, stack: u32, sources: &[String; 2]) -> [String; 2] {
    let Flags { any, count, reduced, cut } = flags;
    let preamble = format!(
        "const STACK: u32 = {stack}u;\nconst ANY: bool = {any};\nconst COUNT: bool = {count};\n\
         const REDUCED: bool = {reduced};\nconst CUT: bool = {cut};\n"
    );
    sources.each_ref().map(|source| preamble.clone() + source)
}

fn compile(source: &str) -> Result<(naga::Module, Vec<u32>), Box<dyn Error>> {
    let module = naga::front::wgsl::parse_str(source).map_err(|e| e.emit_to_string(source))?;
    let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
    let info = validator.validate(&module).map_err(|e| e.emit_to_string(source))?;
    let options = spv::Options {
        // That of Vulkan 1.1 and later.
        lang_version: (1, 3),
        // Fixed: the default differs between debug and release builds.
        flags: spv::WriterFlags::empty(),
        fake_missing_bindings: true,
        // `rt_core::Scene` is checked once, so that kernels may trust every index; stacks are as deep as the scene
        // asks.
        bounds_check_policies: naga::proc::BoundsCheckPolicies::default(),
        zero_initialize_workgroup_memory: spv::ZeroInitializeWorkgroupMemoryMode::None,
        // The loop ends: every step visits another node of a finite tree.
        force_loop_bounding: false,
        ..spv::Options::default()
    };
    let words = spv::write_vec(&module, &info, &options, None)?;
    Ok((module, spirv::mend(&words)?))
}

/// `Binding { … }` for every global variable, in the order of their numbers.
fn bindings(module: &naga::Module) -> Result<String, Box<dyn Error>> {
    let mut rows = Vec::new();
    for (_, variable) in module.global_variables.iter() {
        let Some(binding) = &variable.binding else { continue };
        let naga::AddressSpace::Storage { access } = variable.space else {
            return Err("every binding is a storage buffer".into());
        };
        let row = format!(
            "Binding {{ group: {}, binding: {}, name: {:?}, written: {} }}",
            binding.group,
            binding.binding,
            variable.name.as_deref().ok_or("bindings have names")?,
            access.contains(naga::StorageAccess::STORE)
        );
        rows.push(((binding.group, binding.binding), row));
    }
    rows.sort();
    Ok(rows.into_iter().map(|(_, row)| row).collect::<Vec<_>>().join(", "))
}

/// Offsets of members and sizes of structures, as the kernels see them.
fn layout_table(modules: &[naga::Module]) -> Result<String, Box<dyn Error>> {
    let mut table = String::from("#[cfg(test)]\npub(crate) static LAYOUTS: &[Structure] = &[\n");
    for name in LAYOUTS {
        let mut types = modules.iter().flat_map(|module| module.types.iter());
        let found = types.find(|(_, t)| t.name.as_deref() == Some(name));
        let (_, structure) = found.ok_or_else(|| format!("no structure {name}"))?;
        let naga::TypeInner::Struct { members, span } = &structure.inner else {
            return Err(format!("{name} is no structure").into());
        };
        let members: Vec<String> =
            members.iter().map(|m| format!("({:?}, {})", m.name.as_deref().unwrap_or(""), m.offset)).collect();
        writeln!(table, "    Structure {{ name: {name:?}, size: {span}, members: &[{}] }},", members.join(", "))?;
    }
    table += "];\n";
    Ok(table)
}
