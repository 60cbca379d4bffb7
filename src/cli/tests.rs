use super::understand;
use proptest::prelude::*;
use std::path::Path;

/// Flags and values, sound ones and others.
const WORDS: [&str; 64] = [
    "plan",
    "flux",
    "study",
    "doctor",
    "completions",
    "man",
    "bash",
    "cloud.glb",
    "cloud.vdb",
    "-o",
    "out.vdb",
    "out.exr",
    "out.json",
    "out.blend.py",
    "--photons",
    "10M",
    "1e300",
    "0",
    "-1",
    "nan",
    "inf",
    "--size",
    "640x360",
    "0x0",
    "4294967296x1",
    "--spp",
    "--error",
    "5%",
    "--memory",
    "2G",
    "--density",
    "duality",
    "source",
    "--integrator",
    "grid",
    "photon",
    "path",
    "--sun",
    "1,2,3",
    "0,0,0",
    "1e-320,0,0",
    "--camera",
    "--look-at",
    "--fov",
    "180",
    "--sky",
    "0.1",
    "--sigma-t",
    "--albedo",
    "-g",
    "2",
    "--periodic",
    "xy",
    "--detail",
    "congestus:size=80,strength=0.7",
    "cirrus:",
    "--bake",
    "sh2",
    "--max-mb",
    "--step",
    "--exposure",
    "--progress",
    "json",
    "--json",
];

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_words_are_a_job_or_a_refusal_in_words(
        words in prop::collection::vec(prop_oneof![6 => prop::sample::select(&WORDS[..]).prop_map(String::from), 1 => any::<String>()], 0..12)
    ) {
        if let Err(text) = understand(words.iter().map(Into::into)) {
            prop_assert!(text.trim().len() > 10, "{words:?}: {text:?}");
        }
    }
}

/// The fuzzer's corpus: what once broke something is in it.
#[test]
fn the_corpus_is_understood_or_refused() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fuzz/corpus/command");
    let mut sound = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let text = String::from_utf8_lossy(&std::fs::read(entry.unwrap().path()).unwrap()).into_owned();
        sound += u32::from(understand(text.split('\0').map(Into::into)).is_ok());
    }
    assert!(sound > 5);
}
