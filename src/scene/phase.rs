//! Phase functions: value and sampling, stable at every g.
