"""The paper's experiments on the reference trucks, and the classical models that they are beside."""
