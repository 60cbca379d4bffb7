//! What the thesis measured (chapter 4, tables 3 and 4, and the cumulus of 4.2).

/// One test of the thesis's evaluation, with its own figures.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Test {
    /// Its number in tables 3 and 4; [`CUMULUS`] for the cumulus.
    #[serde(skip)]
    pub number: u8,
    /// Regions of the layout: one, two, three, or many.
    #[serde(skip)]
    pub regions: usize,
    /// Photons stored.
    #[serde(skip)]
    pub photons: u64,
    /// Photons in an estimate.
    #[serde(skip)]
    pub estimate: u64,
    /// The thesis's seconds; none are given for the cumulus.
    pub seconds: Option<f64>,
    /// The thesis's memory, MB.
    pub megabytes: f64,
    /// The regions that the thesis's duality made.
    pub made: f64,
}

/// The number that stands for the cumulus.
pub const CUMULUS: u8 = 10;

/// The nine tests and the cumulus.
pub const TESTS: [Test; 10] = [
    test(1, [1, 10_000, 100], 48.0, 15.0, 20.0),
    test(2, [2, 10_000, 100], 92.0, 22.0, 36.0),
    test(3, [3, 10_000, 100], 617.0, 25.0, 55.0),
    test(4, [1, 100_000, 500], 129.0, 17.0, 35.0),
    test(5, [2, 100_000, 500], 307.0, 20.0, 45.0),
    test(6, [3, 100_000, 500], 788.0, 29.0, 87.0),
    test(7, [1, 1_000_000, 1_000], 5_523.0, 40.0, 35.0),
    test(8, [2, 1_000_000, 1_000], 11_682.0, 60.0, 63.0),
    test(9, [3, 1_000_000, 1_000], 20_253.0, 65.0, 93.0),
    Test { number: CUMULUS, regions: 21, photons: 10_000_000, estimate: 5_000, seconds: None, megabytes: 320.0, made: 256.0 },
];

/// Pixels across and down in the nine tests; the thesis does not give the cumulus's.
pub const SIZE: [u32; 2] = [100, 100];
/// Samples a pixel, and shadow rays, in all of them.
pub const SAMPLES: u32 = 4;

const fn test(number: u8, [regions, photons, estimate]: [u64; 3], seconds: f64, megabytes: f64, made: f64) -> Test {
    Test { number, regions: regions as usize, photons, estimate, seconds: Some(seconds), megabytes, made }
}

impl Test {
    /// The number, or `cumulus`.
    pub fn name(&self) -> String {
        if self.number == CUMULUS { "cumulus".into() } else { self.number.to_string() }
    }

    /// Whether a layout of so many regions is this test's: one, two, three, or more.
    pub fn is_of(&self, regions: usize) -> bool {
        regions == self.regions || regions > 3 && self.number == CUMULUS
    }
}
