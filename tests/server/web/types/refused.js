// What the checker has to refuse: each of these is an error, or `tsc` fails for want of it. Never run.

/** @import { Capture, Device } from "types/documents" */
/** @import { Api } from "types/routes" */

/** @param {Api} api @param {string} id */
export async function addresses(api, id) {
  // @ts-expect-error the API has no such route
  await api.get(`/captures/${id}/pionts`);
  // @ts-expect-error it has the route, but not for this method
  await api.put(`/captures/${id}`);
}

/** @param {Api} api @param {string} id */
export async function bodies(api, id) {
  // @ts-expect-error a capture has no such setting
  await api.post("/captures", { body: { feilds: 500 } });
  // @ts-expect-error it has, but as a number
  await api.post("/captures", { body: { fields: "500" } });
  // @ts-expect-error a group is of devices, not of a device
  await api.post("/capture-groups", { body: { device: id } });
}

/** @param {Api} api @param {string} id */
export async function answers(api, id) {
  const page = await api.get(`/captures?limit=${20}&search=${id}`);
  // @ts-expect-error a page of captures is no list
  page.map(String);
  const one = await api.get(`/captures/${encodeURIComponent(id)}`);
  // @ts-expect-error a capture without a verdict has null for it
  one.verdict.length;
  // @ts-expect-error none of the states of a capture
  return one.state === "finished";
}

/** @param {Capture} capture @param {Device} device */
export function documents(capture, device) {
  // @ts-expect-error the word is `outcome`
  capture.ledger.entries[0].result;
  // @ts-expect-error nothing is measured before there is a calibration
  return device.live.residual_px;
}
