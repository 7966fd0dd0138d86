//! Where trees begin: stems, trunks, and crowns without a visible trunk.

pub(crate) mod crowns;
pub(crate) mod seeds;
pub(crate) mod trunks;
