"""density-peaks (Li et al. 2017, sections 3.2 and 3.3) over a whole cloud with scipy: an independent reference.

    tests/oracle/peaks_oracle.py LABELLED.laz

Takes ground and noise from the classification of a copy that `chainage run` labelled (step 1 mm), and the threshold of
merging from report.json beside it; the other settings are the defaults. Does the method again, prints its stages, and
compares the partition with cluster_id point by point: exit code 1 if it differs. Needs numpy, scipy, laspy; a minute for
two million points."""
import json, pathlib, sys, numpy as np, laspy
from scipy.spatial import cKDTree
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
f=sys.argv[1]; las=laspy.read(f)
c_t=json.loads((pathlib.Path(f).parent/'report.json').read_text())['configuration']['density-peaks']['merge_below']
P=np.rint(np.c_[np.asarray(las.x),np.asarray(las.y),np.asarray(las.z)]*1000).astype(np.int64)
cls=np.asarray(las.classification); pred=np.asarray(las.cluster_id).astype(np.int64)
noise=np.isin(cls,[7,18]); gr=(cls==2)&~noise
obj=np.flatnonzero(~noise&~gr); O=P[obj]
V=O//300; U,inv,n=np.unique(V,axis=0,return_inverse=True,return_counts=True); inv=inv.ravel()
G=np.unique(P[gr]//300,axis=0)
def comps(K):
    t=cKDTree(K); pr=t.query_pairs(1.8,output_type='ndarray')
    d=np.abs(K[pr[:,0]]-K[pr[:,1]]).max(1)<=1; pr=pr[d]
    return connected_components(coo_matrix((np.ones(len(pr)),(pr[:,0],pr[:,1])),shape=(len(K),len(K))),directed=False)[1]
comp=comps(U)
key={tuple(u):x for x,u in enumerate(map(tuple,U))}
N=len(U); L=np.ones(N); pos=np.zeros(N)
order=np.lexsort((U[:,2],U[:,1],U[:,0])); s=0
while s<N:
    e=s+1
    while e<N and (U[order[e],:2]==U[order[s],:2]).all() and U[order[e],2]==U[order[e-1],2]+1: e+=1
    L[order[s:e]]=e-s; pos[order[s:e]]=np.arange(e-s); s=e
# ground columns lowest
gl={}
for i,j,k in G: gl[(i,j)]=min(k,gl.get((i,j),1<<60))
gc=np.array(list(gl)); gk=np.array(list(gl.values())); gt=cKDTree(gc)
cols,ci=np.unique(U[:,:2],axis=0,return_inverse=True); ci=ci.ravel()
low={}
for i,j,k in U: low[(i,j)]=min(k,low.get((i,j),1<<60))
base=np.zeros(len(cols),np.int64); dd,_=gt.query(cols)
for c,(i,j) in enumerate(cols):
    d2=round(dd[c]**2)
    if d2*90000<=10**8:
        c2=gt.query_ball_point((i,j),np.sqrt(d2)+1e-6); base[c]=gk[c2].min()
    else: base[c]=low[(i,j)]
d=(U[:,2]-base[ci]).astype(float)
rho=L-pos/L+n.astype(float)/float(n.max()); rho=np.where(d>=5,rho/np.maximum(d,1),rho)
order=np.lexsort((U[:,0],U[:,1],U[:,2],-rho)); rank=np.empty(N,int); rank[order]=np.arange(N)
t=cKDTree(U); par=np.full(N,-1); del2=np.full(N,169)
todo=np.arange(N)
for r in (1.01,2.01,4.01,8.01,12.999999):
    left=[]
    for b in range(0,len(todo),20000):
        q=todo[b:b+20000]
        for v,nb in zip(q,t.query_ball_point(U[q],r)):
            nb=np.array(nb); nb=nb[(rank[nb]<rank[v])&(comp[nb]==comp[v])]
            if len(nb)==0: left.append(v); continue
            q2=((U[nb]-U[v])**2).sum(1); m=q2.min()
            c=nb[q2==m]; par[v]=c[np.argmin(rank[c])]; del2[v]=m
    todo=np.array(left,int)
lab=np.full(N,-1); C=0
for v in order:
    if rho[v]>4 and del2[v]>9: lab[v]=C; C+=1
    elif par[v]>=0: lab[v]=lab[par[v]]
print('voxels',N,'centres',C,flush=True)
pl=lab[inv]; lp=np.flatnonzero(pl>=0)
cell=np.c_[O[lp]//100,pl[lp]]; _,first=np.unique(cell,axis=0,return_index=True); reps=lp[first]
rt=cKDTree(O[reps].astype(float)); pr=rt.query_pairs(500.0001,output_type='ndarray')
a,b=reps[pr[:,0]],reps[pr[:,1]]; ok=(pl[a]!=pl[b])&(((O[a]-O[b])**2).sum(1)<250000); a,b=a[ok],b[ok]
need=np.unique(np.r_[a,b]); lt=cKDTree((O[lp]-O[lp].min(0)).astype(float)); OF=O-O[lp].min(0)
cur=np.zeros(len(O))
for v in need:
    kd,_=lt.query(OF[v].astype(float),k=20); nb=lp[lt.query_ball_point(OF[v].astype(float),kd[-1]+1e-3)]
    q2=((O[nb]-O[v])**2).sum(1); nb=nb[np.lexsort((*O[nb].T[::-1],q2))][:20]
    X=(O[nb]-O[v]).astype(float); X-=X.mean(0); w=np.linalg.eigvalsh(X.T@X); s=w.sum(); cur[v]=max(w[0],0)/s if s>0 else 0
lo=np.minimum(pl[a],pl[b]); hi=np.maximum(pl[a],pl[b]); k=lo*C+hi
u,iv=np.unique(k,return_inverse=True); cnt=np.bincount(iv); cns=np.bincount(iv,(cur[a]+cur[b])/2)/cnt
print('pairs',len(u),'nearest to C_T',np.abs(cns-c_t).min(),flush=True)
m=cns<c_t
seg=connected_components(coo_matrix((np.ones(m.sum()),(u[m]//C,u[m]%C)),shape=(C,C)),directed=False)[1]
print('after merging',seg.max()+1)
h=np.flatnonzero(lab<0); hc=np.full(N,-1); hc[h]=comps(U[h])
hp=np.flatnonzero(pl<0); best={}
dist,_=lt.query(OF[hp].astype(float),distance_upper_bound=1500.001)
for p,x in zip(hp,dist):
    if not np.isfinite(x): continue
    q2m=round(x*x)
    if q2m>2250000: continue
    cc=hc[inv[p]]
    if cc in best and best[cc][0]<q2m: continue
    nb=lp[lt.query_ball_point(OF[p].astype(float),x+1e-3)]; q2=((O[nb]-O[p])**2).sum(1); g=q2.min(); w=min(nb[q2==g],key=lambda w: tuple(O[w]))
    if cc not in best or (g,*O[w])<(best[cc][0],*O[best[cc][1]]): best[cc]=(g,w)
res=np.where(pl>=0,seg[np.maximum(pl,0)],-1)
for p in hp:
    cc=hc[inv[p]]
    if cc in best: res[p]=seg[pl[best[cc][1]]]
print('halo voxels joined',sum(hc[v] in best for v in h),'dropped',sum(hc[v] not in best for v in h))
mine=pred[obj]; z=(mine==0)!=(res<0)
pairs=set(zip(mine.tolist(),res.tolist())); 
same=z.sum()==0 and len(pairs)==len({x for x,_ in pairs})==len({y for _,y in pairs})
print('none differs at',z.sum(),'points; one-to-one:',same, len(pairs))
sys.exit(0 if same else 1)
