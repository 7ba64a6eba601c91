// The newest job of a kind about something, whether it has ended or not: so a step survives that the page is loaded anew.

/** @import { Context } from "../core/context.js" */
/** @import { Job } from "types/documents" */

/**
 * @param {Context} context
 * @param {string} kind
 * @param {(subject: string) => boolean} isAbout
 * @returns {Promise<Job | null>} null where there is none: the daemon forgets its jobs when it is started
 */
export async function latestJob({ api }, kind, isAbout) {
  const { jobs } = await api.get("/jobs?limit=100");
  return jobs.find((job) => job.kind === kind && isAbout(job.subject)) ?? null;
}
