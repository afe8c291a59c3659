// Creation of page elements.

/**
 * Creates an element with properties and children.
 * @param {string} name
 * @param {object} [properties]
 * @param {(Node | string)[]} children
 * @returns {any}
 */
export function make(name, properties = {}, ...children) {
  const element = Object.assign(document.createElement(name), properties);
  element.append(...children);
  return element;
}
