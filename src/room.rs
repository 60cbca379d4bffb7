//! Whether there is memory for what is asked for: a few bytes of a file, or a figure on the command line, may stand for gigabytes, and a
//! system that promises more than it has would end the process.

/// Why so many bytes are not to be had; nothing where they are, or where the system does not say.
pub fn missing(bytes: u64, free: Option<u64>) -> Option<String> {
    let free = free.filter(|&free| bytes > free)?;
    let gigabytes = |bytes: u64| bytes as f64 / 1e9;
    Some(format!("takes {:.1} GB in memory, and {:.1} GB are free", gigabytes(bytes), gigabytes(free)))
}

/// The memory that programs may still take, bytes; where the system says so (Linux).
pub fn free() -> Option<u64> {
    available(&std::fs::read_to_string("/proc/meminfo").ok()?)
}

fn available(meminfo: &str) -> Option<u64> {
    let line = meminfo.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_there_is_told_before_it_is_taken() {
        assert_eq!(missing(7_500_000_000, Some(2_000_000_000)).unwrap(), "takes 7.5 GB in memory, and 2.0 GB are free");
        assert_eq!(missing(2_000_000_000, Some(2_000_000_000)), None);
        assert_eq!(missing(u64::MAX, None), None);
    }

    #[test]
    fn the_system_is_understood() {
        assert_eq!(available("MemTotal:       24 kB\nMemFree:  1 kB\nMemAvailable:    2048 kB\n"), Some(2 << 20));
        assert_eq!(available("MemTotal: 24 kB\n"), None);
        assert_eq!(available("MemAvailable: many kB\n"), None);
        assert!(cfg!(not(target_os = "linux")) || free().is_some_and(|free| free > 1 << 20));
    }
}
