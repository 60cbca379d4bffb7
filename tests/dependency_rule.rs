//! The house's rule, read off the source: who may know whom, and what the core may not do.
#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};

/// The core, from the ground up: a module knows only those of a smaller number, and itself.
const CORE: [(&str, u32); 20] = [
    ("geom", 0),
    ("rng", 0),
    ("stats", 0),
    ("error", 0),
    ("progress", 1),
    ("sampling", 1),
    ("bvh", 1),
    ("scene", 2),
    ("trimesh", 3),
    ("plan", 3),
    ("voxelise", 4),
    ("sculpt", 5),
    ("media", 4),
    ("photon", 5),
    ("regions", 6),
    ("film", 6),
    ("integrate", 7),
    ("bake", 8),
    ("errata", 8),
    // Here so that every module of the crate has a line: what is neither core nor listed in `REST` fails the test.
    ("lib", 9),
];
const REST: [&str; 10] = ["import", "export", "cli", "cluster", "doctor", "pipeline", "room", "study", "vdb", "main"];

/// One source file: its path below `src`, its top-level module, and its lines without comments and strings.
struct Source {
    path: PathBuf,
    module: String,
    lines: Vec<String>,
    /// The first line of its tests, or beyond the end.
    tests: usize,
    raw_lines: usize,
}

impl Source {
    fn is(&self, path: &str) -> bool {
        self.path == Path::new(path)
    }

    fn rank(&self) -> Option<u32> {
        CORE.iter().find(|c| c.0 == self.module && c.0 != "lib").map(|c| c.1)
    }

    /// `src/file.rs:line: what` for each line (tests apart) in which `wrong` finds something.
    fn offences(&self, tests_too: bool, wrong: impl Fn(&str) -> Option<String>) -> Vec<String> {
        let end = if tests_too { self.lines.len() } else { self.tests };
        let line = |(i, line): (usize, &String)| wrong(line).map(|what| format!("src/{}:{}: {what}", self.path.display(), i + 1));
        self.lines[..end].iter().enumerate().filter_map(line).collect()
    }
}

fn files(folder: &Path, extensions: &[&str], out: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            files(&path, extensions, out);
        } else if path.extension().is_some_and(|e| extensions.iter().any(|x| e == *x)) {
            out.push(path);
        }
    }
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn sources() -> Vec<Source> {
    let (mut paths, src) = (Vec::new(), root().join("src"));
    files(&src, &["rs"], &mut paths);
    assert!(paths.len() > 30, "{paths:?}");
    let one = |path: PathBuf| {
        let text = std::fs::read_to_string(&path).unwrap();
        let path = path.strip_prefix(&src).unwrap().to_path_buf();
        let first = path.components().next().unwrap().as_os_str().to_str().unwrap();
        let lines = code(&text);
        let tests = if path.components().any(|c| c.as_os_str() == "tests.rs" || c.as_os_str() == "tests") {
            0
        } else {
            lines.iter().position(|l| l.contains("#[cfg(test)]")).unwrap_or(lines.len())
        };
        Source { module: first.trim_end_matches(".rs").into(), raw_lines: text.lines().count(), path, lines, tests }
    };
    paths.into_iter().map(one).collect()
}

/// The lines of a Rust file with comments, strings and character literals blanked out.
fn code(text: &str) -> Vec<String> {
    let (mut out, mut chars) = (String::new(), text.chars().peekable());
    let mut raw_end: Option<String> = None;
    let mut before = ' ';
    while let Some(c) = chars.next() {
        match c {
            '/' if chars.peek() == Some(&'/') => {
                while chars.peek().is_some_and(|&c| c != '\n') {
                    chars.next();
                }
            }
            '/' if chars.peek() == Some(&'*') => {
                let mut last = ' ';
                chars.next();
                for c in chars.by_ref() {
                    if c == '\n' {
                        out.push('\n');
                    }
                    if last == '*' && c == '/' {
                        break;
                    }
                    last = c;
                }
            }
            'r' if !(before.is_alphanumeric() || before == '_') && matches!(chars.peek(), Some('"' | '#')) => {
                let mut hashes = String::new();
                while chars.peek() == Some(&'#') {
                    hashes.push('#');
                    chars.next();
                }
                if chars.next_if_eq(&'"').is_some() {
                    raw_end = Some(format!("\"{hashes}"));
                }
            }
            '"' => {
                while let Some(c) = chars.next() {
                    match c {
                        '\\' => out.push_str(if chars.next() == Some('\n') { "\n" } else { "" }),
                        '"' => break,
                        '\n' => out.push('\n'),
                        _ => {}
                    }
                }
                out.push_str("\"\"");
            }
            '\'' => {
                // A character or a lifetime.
                let mut ahead = chars.clone();
                let (first, second) = (ahead.next(), ahead.next());
                if first == Some('\\') {
                    chars.next();
                    chars.next();
                    for c in chars.by_ref() {
                        if c == '\'' {
                            break;
                        }
                    }
                } else if second == Some('\'') {
                    chars.next();
                    chars.next();
                }
                out.push(' ');
            }
            c => out.push(c),
        }
        if let Some(end) = raw_end.take() {
            let mut seen = String::new();
            for c in chars.by_ref() {
                if c == '\n' {
                    out.push('\n');
                }
                seen.push(c);
                if seen.ends_with(&end) {
                    break;
                }
            }
        }
        before = c;
    }
    out.lines().map(String::from).collect()
}

fn words(line: &str) -> impl Iterator<Item = &str> {
    line.split(|c: char| !(c.is_alphanumeric() || c == '_')).filter(|w| !w.is_empty())
}

fn has_word(line: &str, word: &str) -> bool {
    words(line).any(|w| w == word)
}

/// The crate's modules that a line names: `crate::a`, and each of `crate::{a, b::c}`; groups over several lines are joined by `joined`.
fn modules(line: &str) -> Vec<String> {
    let mut found = Vec::new();
    for root in ["crate::", "cloudvdb::"] {
        for (at, _) in line.match_indices(root) {
            let rest = &line[at + root.len()..];
            let Some(group) = rest.strip_prefix('{') else {
                found.extend(words(rest).next().map(String::from));
                continue;
            };
            let (mut depth, mut item) = (0, String::new());
            for c in group.chars() {
                match c {
                    '}' if depth == 0 => break,
                    '{' => depth += 1,
                    '}' => depth -= 1,
                    ',' if depth == 0 => found.extend(words(&std::mem::take(&mut item)).next().map(String::from)),
                    c if depth == 0 => item.push(c),
                    _ => {}
                }
            }
            found.extend(words(&item).next().map(String::from));
        }
    }
    found
}

/// The lines, each with what follows it up to the end of a `{` group that a `use` opens on it.
fn joined(source: &Source) -> Source {
    let lines = (0..source.lines.len())
        .map(|i| {
            let mut line = source.lines[i].clone();
            if line.contains("crate::{") {
                for next in &source.lines[i + 1..] {
                    if line.contains(';') {
                        break;
                    }
                    line.push_str(next);
                }
            }
            line
        })
        .collect();
    Source { path: source.path.clone(), module: source.module.clone(), lines, tests: source.tests, raw_lines: source.raw_lines }
}

fn none(offences: Vec<String>, rule: &str) {
    assert!(offences.is_empty(), "{rule}:\n{}", offences.join("\n"));
}

#[test]
fn every_module_has_its_place() {
    let unknown = |s: &Source| !CORE.iter().any(|c| c.0 == s.module) && !REST.contains(&s.module.as_str());
    let lost: Vec<String> = sources().iter().filter(|s| unknown(s)).map(|s| format!("src/{}:1", s.path.display())).collect();
    none(lost, "a module that this test's tables do not place: add it to CORE or REST");
}

#[test]
fn the_core_knows_nothing_above_it() {
    let mut wrong = Vec::new();
    for source in sources().iter().filter(|s| s.rank().is_some()) {
        let rank = source.rank().unwrap();
        // The eight by name, however they are reached.
        wrong.extend(source.offences(true, |line| {
            ["import", "export", "cli", "cluster", "doctor", "pipeline", "study", "vdb"]
                .iter()
                .find(|w| has_word(line, w))
                .map(|w| format!("names {w}"))
        }));
        wrong.extend(joined(source).offences(false, |line| {
            modules(line).into_iter().find_map(|m| {
                let other = CORE.iter().find(|c| c.0 == m)?;
                (other.0 != source.module && other.1 >= rank).then(|| format!("{} knows {m}", source.module))
            })
        }));
    }
    none(wrong, "core modules know only those below them, and none of import, export, cli, cluster, doctor, pipeline, study, vdb");
}

#[test]
fn only_import_export_doctor_and_the_pipeline_name_vdb_and_only_the_map_names_kiddo() {
    let mut wrong = Vec::new();
    for source in &sources() {
        if !["import", "export", "doctor", "pipeline", "vdb"].contains(&source.module.as_str()) {
            wrong.extend(joined(source).offences(true, |line| modules(line).contains(&"vdb".into()).then(|| "names crate::vdb".into())));
        }
        if source.is("pipeline.rs") {
            let only_meta = |line: &str| line.contains("crate::vdb") && !line.contains("crate::vdb::Meta");
            wrong.extend(source.offences(true, |line| only_meta(line).then(|| "takes more than Meta".into())));
        }
        if !source.is("photon/map.rs") {
            wrong.extend(source.offences(true, |line| has_word(line, "kiddo").then(|| "names kiddo".into())));
        }
    }
    none(wrong, "crate::vdb is for import, export and doctor (and Meta for the pipeline), kiddo for photon/map.rs");
}

#[test]
fn the_core_opens_no_file_prints_nothing_and_reads_no_clock() {
    let forbidden = ["OpenOptions", "Instant", "SystemTime", "println", "eprintln", "print", "eprint", "dbg", "stdout", "stderr"];
    let paths = ["std::fs", "std::io", "std::time", "std::env", "std::process", "std::net", "File::"];
    let mut wrong = Vec::new();
    for source in sources().iter().filter(|s| s.rank().is_some() || s.module == "lib") {
        wrong.extend(source.offences(false, |line| {
            let word = forbidden.iter().find(|w| has_word(line, w));
            word.or_else(|| paths.iter().find(|p| line.contains(**p))).map(|w| format!("uses {w}"))
        }));
    }
    none(wrong, "the core opens no file, prints nothing, reads no clock");
}

#[test]
fn unsafe_is_in_the_bridge_alone() {
    let mut wrong = Vec::new();
    for source in sources().iter().filter(|s| !s.is("vdb/ffi.rs")) {
        let lifted = |line: &str| line.contains("allow(") && has_word(line, "unsafe_code");
        wrong.extend(source.offences(true, |line| (has_word(line, "unsafe") || lifted(line)).then(|| "unsafe".into())));
    }
    none(wrong, "unsafe is for vdb/ffi.rs alone");
}

#[test]
fn openvdb_headers_stay_in_translation_units() {
    let (mut paths, mut wrong, mut units) = (Vec::new(), Vec::new(), 0);
    for folder in ["cpp", "src"] {
        files(&root().join(folder), &["h", "hpp", "hh", "inl", "rs", "cc"], &mut paths);
    }
    for path in paths {
        let text = std::fs::read_to_string(&path).unwrap();
        for (i, line) in text.lines().enumerate() {
            let line = line.trim_start();
            if (line.starts_with("#include") || line.starts_with("include!")) && (line.contains("openvdb/") || line.contains("nanovdb/")) {
                match path.extension().is_some_and(|e| e == "cc") {
                    true => units += 1,
                    false => wrong.push(format!("{}:{}: {line}", path.display(), i + 1)),
                }
            }
        }
    }
    assert!(units > 0, "the test looks in the wrong place");
    none(wrong, "OpenVDB's headers are for cpp/*.cc");
}

#[test]
fn no_file_is_longer_than_450_lines() {
    let long = |s: &Source| (s.raw_lines > 450).then(|| format!("src/{}:{}", s.path.display(), s.raw_lines));
    none(sources().iter().filter_map(long).collect(), "no source file over 450 lines");
}

#[test]
fn the_reader_sees_code_and_nothing_else() {
    let text = "use crate::{a, b::{c, d}, vdb::Meta};\nlet s = \"kiddo // x\"; // kiddo\nlet c = '\"'; let r = r#\"unsafe\nunsafe\"#; foo::<'a>();\n/* kiddo\n */ kiddo";
    let lines = code(text);
    assert_eq!(modules(&lines[0]), ["a", "b", "vdb"]);
    assert_eq!(lines.iter().filter(|l| has_word(l, "kiddo")).count(), 1);
    assert!(has_word(&lines[5], "kiddo") && !lines.iter().any(|l| has_word(l, "unsafe")), "{lines:?}");
    assert!(has_word(&lines[3], "foo"));
}
