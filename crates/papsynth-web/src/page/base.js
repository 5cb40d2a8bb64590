"use strict";

// Functions of all pages; loaded first.

const element = (id) => document.getElementById(id);

/** Passes a request to the server, or to the engine of a page without a server, and returns the response. */
let send = (path, options) => fetch(path, options);

/** Sends a request. Throws the message of the reply with its status, or an error without a status if there is none. */
async function request(path, body) {
  const options = { cache: "no-store" };
  if (body !== undefined) {
    options.method = "POST";
    options.headers = { "Content-Type": "application/json" };
    options.body = JSON.stringify(body);
  }
  const response = await send(path, options);
  if (response.ok) return response;
  const { error } = await response.json().catch(() => ({ error: response.statusText }));
  throw Object.assign(new Error(error), { status: response.status });
}

/** Formats a number with a typographic minus sign, and without one before zero. */
const minus = (value, digits) => (Number(value.toFixed(digits)) || 0).toFixed(digits).replace("-", "−");
