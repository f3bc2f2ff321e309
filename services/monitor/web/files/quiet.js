// SPDX-License-Identifier: Apache-2.0
// Before Rerun's viewer: it sends usage data, which the page's policy forbids, and writes thousands of lines about its shaders.
"use strict";

{
  const fetchFromHere = window.fetch;
  window.fetch = (what, how) =>
    new URL(what.url || what, location).origin === location.origin ? fetchFromHere(what, how) : Promise.reject(new TypeError("not from this page"));
  console.debug = console.info = () => {};
}
