//! Compiles the bridge to OpenVDB (`cpp/`) and links what Debian's libopenvdb needs.
//!
//! Headers are looked for before anything is compiled, so that a missing package is one sentence that says what to
//! install, and not a page of the compiler's. Headers elsewhere than in `/usr/include` and `/usr/local/include` are
//! found by `CPLUS_INCLUDE_PATH`, libraries by `LIBRARY_PATH`, as the compiler finds them.

/// A header of each Debian package that OpenVDB's own headers pull in.
const NEEDED: [(&str, &str); 4] = [
    ("openvdb/openvdb.h", "libopenvdb-dev"),
    ("boost/uuid/uuid.hpp", "libboost-dev"),
    ("Imath/half.h", "libimath-dev"),
    ("tbb/parallel_for.h", "libtbb-dev"),
];

/// Checks for the headers, compiles the bridge, and tells cargo what to link and what to watch.
fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=cpp");
    println!("cargo::rerun-if-changed=src/vdb/ffi.rs");
    println!("cargo::rerun-if-env-changed=CPLUS_INCLUDE_PATH");

    let extra = std::env::var_os("CPLUS_INCLUDE_PATH").unwrap_or_default();
    let roots: Vec<_> = std::env::split_paths(&extra).chain(["/usr/include".into(), "/usr/local/include".into()]).collect();
    let missing: Vec<_> =
        NEEDED.iter().filter(|(header, _)| !roots.iter().any(|root| root.join(header).exists())).map(|&(_, package)| package).collect();
    if !missing.is_empty() {
        println!(
            "cargo::error=OpenVDB's headers are not complete: {} missing. \
             On Debian and Ubuntu: sudo apt-get install libopenvdb-dev libboost-dev libimath-dev libtbb-dev",
            missing.join(", ")
        );
        return;
    }

    let mut build = cxx_build::bridge("src/vdb/ffi.rs");
    build.files(
        ["aborted", "chunks", "vdb_bridge", "vdb_carry", "vdb_container", "vdb_examine", "vdb_mesh", "vdb_read"]
            .map(|name| format!("cpp/{name}.cc")),
    );
    if std::env::var_os("CARGO_FEATURE_BENCH_BASELINE").is_some() {
        build.file("cpp/bench_baseline.cc");
    }
    // OpenVDB's headers are slow without optimisation, also in debug builds; their warnings are not ours.
    // Their debug information would double the time and the memory that compiling them takes.
    build.std("c++17").opt_level(2).debug(false).define("NDEBUG", None).flag_if_supported("-Wno-unused-parameter");
    // Clippy runs this for itself and links nothing: its bridge would be compiled for nobody, for minutes.
    let wrapper = std::env::var_os("RUSTC_WORKSPACE_WRAPPER").unwrap_or_default();
    if std::path::Path::new(&wrapper).file_stem().is_some_and(|name| name == "clippy-driver") {
        return;
    }
    build.compile("cloudvdb_bridge");
    for library in ["openvdb", "tbb", "Imath-3_1"] {
        println!("cargo::rustc-link-lib={library}");
    }
}
