//! Form factors `F_ij`: the fraction of what leaves element *i* that arrives at element *j*.

pub mod analytic;
