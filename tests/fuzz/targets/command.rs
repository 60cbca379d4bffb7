#![no_main]
use std::ffi::OsString;
use std::os::unix::ffi::OsStringExt;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let words = data.split(|&b| b == 0).map(|word| OsString::from_vec(word.to_vec()));
    let _ = cloudvdb::cli::understand(words);
});
