//! What items give, as bytes on their way: numbers as the machine has them, behind their count. Ranks are of one kind.

use bytemuck::{AnyBitPattern, NoUninit, Pod};

/// What can travel.
pub trait Parcel: Sized + Send {
    /// Appends it.
    fn pack(&self, into: &mut Vec<u8>);

    /// Takes it from the front; `None` where that is not one.
    fn unpack(from: &mut Parcels) -> Option<Self>;
}

impl<T: NoUninit + AnyBitPattern + Send> Parcel for Vec<T> {
    fn pack(&self, into: &mut Vec<u8>) {
        put(self, into);
    }

    fn unpack(from: &mut Parcels) -> Option<Self> {
        from.take()
    }
}

/// Values where there are any.
impl<T: Pod + Send> Parcel for Option<T> {
    fn pack(&self, into: &mut Vec<u8>) {
        put(self.as_slice(), into);
    }

    fn unpack(from: &mut Parcels) -> Option<Self> {
        let values: Vec<T> = from.take()?;
        (values.len() < 2).then(|| values.first().copied())
    }
}

/// Appends values, with their count.
pub fn put<T: NoUninit>(values: &[T], into: &mut Vec<u8>) {
    into.extend((values.len() as u64).to_le_bytes());
    into.extend(bytemuck::cast_slice::<T, u8>(values));
}

/// What is left of bytes.
#[derive(Debug)]
pub struct Parcels<'a>(pub &'a [u8]);

impl Parcels<'_> {
    /// Takes values that were [`put`].
    pub fn take<T: NoUninit + AnyBitPattern>(&mut self) -> Option<Vec<T>> {
        let (count, rest) = self.0.split_at_checked(8)?;
        let count = usize::try_from(u64::from_le_bytes(count.try_into().ok()?)).ok()?;
        let (values, rest) = rest.split_at_checked(count.checked_mul(size_of::<T>())?)?;
        self.0 = rest;
        Some(values.chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned).collect())
    }

    /// Takes so many values.
    pub fn some<T: NoUninit + AnyBitPattern, const N: usize>(&mut self) -> Option<[T; N]> {
        self.take()?.try_into().ok()
    }

    /// Takes one thing, after which nothing may be left.
    pub fn whole<T: Parcel>(mut self) -> Option<T> {
        T::unpack(&mut self).filter(|_| self.0.is_empty())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_put_is_taken_and_what_is_cut_is_refused() {
        let mut bytes = Vec::new();
        put(&[1.5f64, -2.0], &mut bytes);
        put(&[7u8, 8, 9], &mut bytes);
        put(&[0x0102_0304u32], &mut bytes);
        let mut all = Parcels(&bytes);
        assert_eq!((all.take(), all.some()), (Some(vec![1.5f64, -2.0]), Some([7u8, 8, 9])));
        assert_eq!((all.some(), all.0.len()), (Some([0x0102_0304u32]), 0));
        assert_eq!(Parcels(&bytes).some::<f64, 3>(), None);
        assert_eq!(Parcels(&bytes[..23]).take::<f64>(), None);
        let mut bytes = Vec::new();
        [None, Some(7u32)].iter().for_each(|option| option.pack(&mut bytes));
        let mut both = Parcels(&bytes);
        assert_eq!((Parcel::unpack(&mut both), Parcel::unpack(&mut both)), (Some(None::<u32>), Some(Some(7u32))));
        assert_eq!(both.whole::<Option<u32>>(), None);
        assert_eq!(Parcels(&u64::MAX.to_le_bytes()).take::<f64>(), None);
    }
}
