// Studio as a page with one layout and no account.

const { App, FoxgloveWebSocketDataSourceFactory, RemoteDataSourceFactory, initI18n, migrateLayout } = self;
const { React, ReactDOM } = self;
const LAYOUT = "sonard";

/** A map where Studio looks for its settings. */
function settings(values) {
  const map = new Map(Object.entries(values));
  return {
    get: (key) => map.get(key),
    set: async (key, value) => void map.set(key, value),
    addChangeListener() {},
    removeChangeListener() {},
  };
}

/** A map where Studio looks for its layouts. */
function layouts(data) {
  const baseline = { data, savedAt: new Date().toISOString() };
  const only = { id: LAYOUT, name: LAYOUT, permission: "CREATOR_WRITE", baseline };
  const map = new Map([[LAYOUT, migrateLayout(only)]]);
  return {
    list: async () => [...map.values()],
    get: async (_namespace, id) => map.get(id),
    put: async (_namespace, layout) => map.set(layout.id, layout).get(layout.id),
    delete: async (_namespace, id) => void map.delete(id),
    importLayouts: async () => {},
  };
}

// The layout is chosen, no sidebar is open, and nothing is explained above the plan.
const onboarding = { settingsTooltipShownForPanelTypes: ["3D"] };
localStorage.setItem("studio.profile-data", JSON.stringify({ currentLayoutId: LAYOUT, onboarding }));
localStorage.setItem("fox.workspace", JSON.stringify({ state: { sidebarItem: null }, version: 0 }));

await initI18n();
const layout = await (await fetch("layout.json")).json();
const app = React.createElement(App, {
  appConfiguration: settings({ colorScheme: "light", timezone: "UTC", "ui.open-dialog-startup": false }),
  dataSources: [new FoxgloveWebSocketDataSourceFactory(), new RemoteDataSourceFactory()],
  deepLinks: [location.href],
  enableGlobalCss: true,
  extensionLoaders: [],
  layoutStorage: layouts(layout),
});
ReactDOM.render(app, document.getElementById("root"));
