// What `el` of core/dom.js takes.

export type Child = Node | string | number | null | undefined | false | Child[];

export interface Attributes {
  class?: string;
  on?: { [Name in keyof HTMLElementEventMap]?: (event: HTMLElementEventMap[Name]) => void };
  data?: Record<string, string | number>;
  [attribute: string]: unknown;
}
