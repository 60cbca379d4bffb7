//! The thesis's errata: twelve traps in its text, what each costs, what is right, and the experiment that shows it.
//!
//! The thesis is Joseph Hura's, *Ray tracing clouds using a stochastic photon-particle duality* (2006). `--model hura2006`
//! ([`Model::Hura2006`]) follows it to the letter, `--model physical` ([`Model::Physical`], the default) is the corrected
//! reading. Traps 1 to 7 and 12 are in pass 1 and in the duality, 8 to 11 and eqs 23 and 30 in pass 2
//! ([`integrate::photon`](crate::integrate::photon)); there the experiments test the form, and the renderer's own tests the renderer.
//!
//! | trap | where | what is wrong | what it costs |
//! | --- | --- | --- | --- |
//! | [1](#1-phase-functions-that-are-not-normalised) | eqs 5, 6 | not normalised | 12.6 times the light at each scattering |
//! | [2](#2-the-logarithm-of-zero) | eq. 17 | ln 0 at xi = 0 | an endless flight in 2^24 (or 2^53) draws |
//! | [3](#3-the-angle-of-scattering) | eq. 19 | 0/0 at g = 0, cancellation near it and near 1 | all digits of a float at g = 1e-7 |
//! | [4](#4-the-density-of-the-nearest-photons) | eqs 23, 30 | biased by n/(n - 1); balls that reach outside | 1 % at n = 100; half the light at a boundary |
//! | [5](#5-attenuated-twice) | eq. 25 | attenuates what eq. 17 has sampled | half the power on each flight |
//! | [6](#6-absorbed-photons-are-stored) | 3.3.1 | stores absorbed photons at full power | 1/albedo too bright: 1.25 |
//! | [7](#7-balls-of-the-same-total-volume) | eq. 27 | holes, overlap, no end | 37 % of a region empty, however many balls |
//! | [8](#8-the-old-light-in-the-new-regions) | 3.3.1, 3.3.2 | the old medium's photons light the new one | a shaded side with a third of its light |
//! | [9](#9-steps-of-the-first-order) | eqs 28, 29, 31 | a step's light is not attenuated within it | 1 % at sigma dx = 0.02, 58 % at 1 |
//! | [10](#10-photons-counted-twice) | 3.3.2, case 1 | each region is marched with all photons | twice the light where two regions coincide |
//! | [11](#11-radiance-added-to-irradiance) | 3.3.2, case 2 | adds W m^-2 sr^-1 to W m^-2 | a third of an overcast sky, 32 times a far cloud |
//! | [12](#12-a-medium-that-is-no-cloud) | 4.1 | albedo 0.8 | a thick layer reflects 2.9 % and not 88 % |
//!
//! Every figure on this page is asserted by a test of that trap's number (`cargo test errata`; the names are given below): against
//! a closed form at 4.5 sigma where there is one, otherwise as it is printed here. Sigma is sigma_t, tau an optical depth, xi a
//! uniform random number in [0, 1).
//!
//! # 1. Phase functions that are not normalised
//!
//! Section 3.1.1 asks for phase functions that integrate to 1 over the sphere; eq. 5 (isotropic: 1) and eq. 6
//! (Rayleigh: 3/4 (1 + cos^2) / lambda^4) do not. Eq. 6 depends on the unit of the wavelength besides.
//!
//! | | eq. 5 | eq. 6, 1 um | eq. 6, 0.65 um | eq. 6, 0.45 um | eq. 7 |
//! | --- | --- | --- | --- | --- | --- |
//! | integral | 12.566 | 12.566 | 70.4 | 306.5 | 1 |
//!
//! A collision would send out 12.6 times, in blue 306 times, the light that it scatters. Physical: only
//! [eq. 7](crate::scene::phase::henyey_greenstein) is used, which is right, and isotropic at g = 0. Eq. 6 over 4 pi without lambda^-4 integrates
//! to 1; lambda^-4 belongs in sigma_s. Test: `trap_01_phase_functions_that_do_not_integrate_to_one`.
//!
//! # 2. The logarithm of zero
//!
//! Eq. 17 takes d = -ln(xi) / sigma with xi in [0, 1): at 0 the photon flies infinitely far, and its position is NaN along an
//! axis in which it does not move. Random numbers of 24 bits are 0 once in 2^24 = 17 million draws (counted), those of 53 bits
//! once in 2^53. The longest flight short of that ends at optical depth 16.6 with 24 bits, 36.7 with 53. Physical:
//! -ln(1 - xi) with 53 bits ([`Rng::optical_depth`]), finite always, at most 36.7. Test: `trap_02_the_logarithm_of_zero`.
//!
//! # 3. The angle of scattering
//!
//! Eq. 19 divides by 2g what cancels as g goes to 0: it is 0/0 at g = 0. The largest error of its cosine, over 1,024 xi:
//!
//! | g | 0.1 | 1e-3 | 1e-5 | 1e-7 | 1e-9 |
//! | --- | --- | --- | --- | --- | --- |
//! | double | 2e-15 | 2e-13 | 3e-11 | 2e-9 | 1e-7 |
//! | single | 1e-6 | 1e-4 | 1e-2 | 1 | 1 |
//!
//! Near g = 1 the cosine itself has no digits for small angles, rounds to 1 or above, and has to be clamped. The share of draws in
//! single precision that go exactly straight on:
//!
//! | g | 0.9 | 0.99 | 0.999 | 0.9999 |
//! | --- | --- | --- | --- | --- |
//! | straight on | below 1e-4 | 4e-4 | 6.0 % | 59.1 % |
//!
//! Physical: [`sample_henyey_greenstein`] computes 1 - cos and 1 + cos as products, never divides by g, and takes the sine from
//! their product: none of the same draws goes straight on. Tests: `trap_03_eq_19_loses_its_digits_near_g_0`,
//! `trap_03_eq_19_scatters_straight_on_near_g_1`.
//!
//! # 4. The density of the nearest photons
//!
//! Eqs 23 and 30 divide n photons by the ball that reaches the n-th of them, which lies on the ball's surface and not inside. For
//! uniform points the mean is the true density times n/(n - 1); with n = 1 there is none.
//!
//! | n | 2 | 5 | 10 | 100 |
//! | --- | --- | --- | --- | --- |
//! | n / ball | 2 | 1.25 | 1.111 | 1.010 |
//! | (n - 1) / ball | 1 | 1 | 1 | 1 |
//!
//! Near a boundary a part of the ball lies outside, where no photons can be. With n = 100 and (n - 1), below a plane, by the depth
//! in radii of the ball that would hold them far inside:
//!
//! | depth | 0 | 0.5 | 1 |
//! | --- | --- | --- | --- |
//! | (n - 1) / ball | 0.5 | 0.828 | 1.000 |
//! | (n - 1) / the ball's part inside | 1 | 1 | 1 |
//!
//! Physical: n - 1 photons over the optical mass that the ball holds ([`Media::mass_within`](crate::media::Media::mass_within)), and a
//! least radius. Tests:
//! `trap_04_n_over_the_ball_is_too_much_by_n_over_n_less_one`, `trap_04_the_ball_is_half_empty_at_a_boundary`.
//!
//! # 5. Attenuated twice
//!
//! Eq. 25 multiplies a photon's power by e^-tau of the way that it has flown. But eq. 17 has drawn that way so that fewer photons
//! come far: 3.2.1 itself says that this "eliminates the need to reduce the power". With tau exponential the mean of e^-tau is 1/2:
//! each flight loses half. Where nothing escapes, with albedo 0.8, 5/6 of all light is lost in that way and 1/6 absorbed. In a
//! sphere of the thesis's medium, six free paths in radius (the thesis tells no radii):
//!
//! | | lost ([`Fate::Attenuated`]) | absorbed | escaped |
//! | --- | --- | --- | --- |
//! | hura2006 | 78.0 % | 16.1 % | 5.8 % |
//! | physical | 0 | 72.4 % | 27.6 % |
//!
//! Physical: no attenuation. Test: `trap_05_each_flight_loses_half_its_power_again`.
//!
//! # 6. Absorbed photons are stored
//!
//! Section 3.3.1 stores a photon before it ends in absorption, at full power; eqs 21 to 23 take what is stored for what is
//! scattered. Full power at every collision from the second on, in the same sphere, is 1.25 = 1/0.8 of the power that scatters
//! there by [`flux`](crate::integrate::flux::flux), which stores nothing. Trap 5 does not make up for it: both together give 0.148
//! of it. Physical: every stored photon weighs the albedo ([`Photon::power`](crate::photon::Photon::power)), which gives 1.
//! Test: `trap_06_absorbed_photons_are_stored_too`.
//!
//! # 7. Balls of the same total volume
//!
//! Eq. 27 keeps new regions while their volumes add up to no more than the old one's, "until all VRs are analysed". Random balls
//! overlap, so that the same volume in total does not fill the region: of N equal balls a point meets none with probability
//! (1 - 1/N)^N, which goes to 1/e.
//!
//! | balls | 10 | 100 | 1000 |
//! | --- | --- | --- | --- |
//! | in none | 34.9 % | 36.6 % | 36.8 % |
//! | in two or more | 26.4 % | 26.4 % | 26.4 % |
//!
//! The duality's own balls, with distances by eq. 17, do the same: deep inside a sphere of 24 free paths, filled with photons,
//! 34 % (sigma 2 %) of the volume is in none of some 1,100 balls, which is what their sizes let expect. In the sphere of trap 5 the thesis's first setting
//! (10,000 photons, 100 in the estimate) gives 16.4 balls; 23 % of their volume sticks out of the sphere, and 46 % of the sphere is
//! in none. Nor is there an end: where too few photons lie within any distance, the search goes on for ever, and what is left of
//! the volume never closes (99.8 % after 4,359 candidates, 4,096 of them in vain).
//!
//! Physical: the budget is the optical mass, the last ball is shrunk to close it exactly, [`REFUSALS`] in a row end the search and
//! the shortfall is reported. Holes, overlap and sticking out stay, because they are the method; extinction adds where balls
//! overlap, and what sticks out is measured ([`Synthesis::sticking_out`]). Tests:
//! `trap_07_balls_of_the_whole_volume_leave_a_third_of_it_empty`,
//! `trap_07_so_does_the_duality_in_the_middle_of_a_large_sphere`, `trap_07_and_08_the_thesis_s_own_sphere`.
//!
//! # 8. The old light in the new regions
//!
//! The thesis renders the new regions with the photons that were stored in the old ones. These know nothing of the holes: in the
//! sphere of traps 5 and 7, 1.39 % of the sunlight crosses the old region without a collision, and 18 % the new ones. 43 % of the
//! stored photons lie in no new region, so that none is drawn there, and 20 % in several. In the third of the height that is
//! farthest from the sun, the old photons that lie in new regions carry 35 % (sigma 3 %) of the power that scatters there when photons are
//! traced through the new ones. Physical: the first map only places the regions; the picture's light goes through the regions
//! that are seen. Test: `trap_07_and_08_the_thesis_s_own_sphere`.
//!
//! # 9. Steps of the first order
//!
//! Eqs 28, 29 and 31 add sigma_s dx of a step's light, but let e^(-sigma dx) of what lies behind through. A constant source comes out
//! too bright by sigma dx / (1 - e^(-sigma dx)), however thick the medium:
//!
//! | sigma dx | 0.02 | 0.1 | 0.5 | 1 |
//! | --- | --- | --- | --- | --- |
//! | eq. 28 / truth | 1.010 | 1.051 | 1.271 | 1.582 |
//!
//! Neither model has this error, as the text names no step: a point is drawn in each slice of the chance of a collision, which is
//! eq. 31 in the limit of short steps, whatever `--step` says. Test:
//! `trap_09_a_step_of_the_first_order_is_too_bright`.
//!
//! # 10. Photons counted twice
//!
//! In case 1 a ray that leaves a region goes on to those "behind or inside" it, and each is marched whole, with its own extinction
//! and the photons of the whole map. Where two regions overlap, the photons of both are gathered in both. Two like stretches of a
//! ray, each 2 m long, the second from 0, 1 or 2 m on, with uniform photons; the marched radiance over that of one march through
//! the sum:
//!
//! | sigma, 1/m | from 0 m (coincident) | from 1 m (half) | from 2 m (touching) |
//! | --- | --- | --- | --- |
//! | 0.0001 | 2 | 1.500 | |
//! | 0.5 | 2 | 1.443 | 1 |
//! | 5 | 2 | 1.007 | |
//!
//! Physical: one march through all regions in order, with the sum of their extinctions. Tests:
//! `trap_10_recursion_counts_photons_twice_where_regions_overlap`; of the renderer itself,
//! `to_the_letter_a_coincident_region_is_lit_twice`.
//!
//! # 11. Radiance added to irradiance
//!
//! In case 2 the shadow ray's marched radiance (W m^-2 sr^-1) is added to the sun's irradiance (W m^-2) on a surface, as though
//! the cloud filled 1 sr in every case. A ball of radiance 1 straight above gives an irradiance of pi / distance^2 (in radii):
//!
//! | distance, radii | 1 (overcast) | 2 | 10 |
//! | --- | --- | --- | --- |
//! | irradiance, W m^-2 | pi | 0.785 | 0.031 |
//! | case 2 | 1 | 1 | 1 |
//!
//! A third of it, 1.3 times, 32 times; and surfaces beside the shadow get none. Physical: the sun's irradiance times the transmittance;
//! what clouds scatter onto a surface is an integral over directions, drawn one at a time. Test: `trap_11_radiance_is_no_irradiance`.
//!
//! # 12. A medium that is no cloud
//!
//! The scenes of table 2 have sigma_s 0.8, sigma_a 0.2 and g 0.9. With albedo 0.8 light collides 1 / (1 - albedo) = 5 times before it
//! is absorbed; in a cloud, with albedo 0.9999, 10,000 times, so that it leaves first. A layer of optical depth 100, the sun
//! overhead:
//!
//! | medium | albedo | g | reflected | scatterings |
//! | --- | --- | --- | --- | --- |
//! | hura2006 | 0.8 | 0.9 | 2.9 % | 3.88 |
//! | cumulus | 0.9999 | 0.86 | 87.7 % | 237 |
//!
//! Physical: the same medium where the file asks for it (the preset `hura2006`); clouds by the other presets
//! ([`Medium::preset`](crate::scene::Medium::preset)). Test: `trap_12_the_thesis_s_medium_is_no_cloud`.
//!
//! [`Model::Hura2006`]: crate::photon::Model::Hura2006
//! [`Model::Physical`]: crate::photon::Model::Physical
//! [`sample_henyey_greenstein`]: crate::scene::phase::sample_henyey_greenstein
//! [`Rng::optical_depth`]: crate::rng::Rng::optical_depth
//! [`Fate::Attenuated`]: crate::photon::trace::Fate::Attenuated
//! [`REFUSALS`]: crate::regions::REFUSALS
//! [`Synthesis::sticking_out`]: crate::regions::Synthesis::sticking_out

#[cfg(test)]
mod tests;
