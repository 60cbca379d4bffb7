//! The `cloudvdb` command.

fn main() -> std::process::ExitCode {
    cloudvdb::cli::main().into()
}
