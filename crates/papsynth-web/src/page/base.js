"use strict";

// What all pages share: they are loaded after this.

const element = (id) => document.getElementById(id);

/** Asks the server. Throws what it says against that, with its status; without a status if it does not answer. */
async function request(path, body) {
  const options = { cache: "no-store" };
  if (body !== undefined) {
    options.method = "POST";
    options.headers = { "Content-Type": "application/json" };
    options.body = JSON.stringify(body);
  }
  const response = await fetch(path, options);
  if (response.ok) return response;
  const { error } = await response.json().catch(() => ({ error: response.statusText }));
  throw Object.assign(new Error(error), { status: response.status });
}

/** A number with a minus that is as wide as a digit, and none before zero. */
const minus = (value, digits) => (Number(value.toFixed(digits)) || 0).toFixed(digits).replace("-", "−");
