"""What bound of a decoded field at points of its surface could be proven from what a file may state?"""
import sys, numpy as np, isowave
rng = np.random.default_rng(1)
S = np.full((4,4,4), 0.5625)
for z in range(4):
  for y in range(4):
    for x in range(4):
      ones=(x==1)+(y==1)+(z==1)
      if ones==3: S[z,y,x]=1
      elif ones==2 or all(v%3==0 for v in (x,y,z)) or (x,y,z)==(2,2,2): S[z,y,x]=0.625
def code(b):  # rounded up to 16 steps a doubling, as the file's byte
  e=np.floor(np.log2(np.maximum(b,1e-30)))-4; q=2.0**e; return np.where(b>0,np.ceil(b/q)*q,0)
def load(name):
  if name.startswith('generate'): return None
  return np.asarray(isowave.open(name).decode() if 0 else isowave.open(name, exact=True).decode())
def blocks(a, n, f):
  z,y,x=[-(-s//n)*n for s in a.shape]; p=np.zeros((z,y,x),a.dtype); p[:a.shape[0],:a.shape[1],:a.shape[2]]=a
  r=f(p.reshape(z//n,n,y//n,n,x//n,n),axis=(1,3,5))
  return np.repeat(np.repeat(np.repeat(r,n,0),n,1),n,2)[:a.shape[0],:a.shape[1],:a.shape[2]]
for name,iso,how in [(a.split(',')[0],float(a.split(',')[1]),h) for h in (dict(rate=8),dict(tolerance_relative=0.004)) for a in sys.argv[1:]]:
  src=load(name).astype(np.float64)
  vol=isowave.compress(src.astype(np.float32), **how); dec=np.asarray(vol.decode()).astype(np.float64)
  err=dec-src; a=np.abs(err)
  shares=np.tile(S,[-(-s//4) for s in a.shape])[:a.shape[0],:a.shape[1],:a.shape[2]]
  whole=code(blocks(a/shares,4,np.max))*shares
  worst=code(blocks(a,4,np.max))
  half=code(blocks(a,2,np.max))
  own=a
  up=blocks(np.maximum(err,0),4,np.max); down=blocks(np.maximum(-err,0),4,np.max)
  inside=dec>=iso
  c=np.zeros([s-1 for s in inside.shape],int)
  for k in range(8): 
    sl=tuple(slice(b,s-1+b) for b,s in zip(((k>>2)&1,(k>>1)&1,k&1),inside.shape)); c+=inside[sl]
  z,y,x=np.nonzero((c>0)&(c<8)); 
  pick=rng.choice(len(z),min(len(z),200000),replace=False); z,y,x=z[pick],y[pick],x[pick]
  # points of the decoded surface: on a random line through the cell, where the trilinear field is iso
  f=rng.random((3,len(z))); g=rng.random((3,len(z)))
  def at(v,p):
    r=0
    for k in range(8):
      d=((k>>2)&1,(k>>1)&1,k&1); w=1
      for q,b in zip(p,d): w=w*(q if b else 1-q)
      r=r+w*v[z+d[0],y+d[1],x+d[2]]
    return r
  f0,f1=at(dec,f)-iso,at(dec,g)-iso; ok=f0*f1<0; lo,hi=np.zeros(len(z)),np.ones(len(z))
  for _ in range(40):
    m=(lo+hi)/2; p=f+(g-f)*m; v=at(dec,p)-iso; same=(v>0)==(f0>0); lo=np.where(same,m,lo); hi=np.where(same,hi,m)
  p=f+(g-f)*lo; e=np.abs(at(err,p))[ok]
  out=[]
  for n,b in (('file today',whole),('block worst',worst),('2^3 groups',half),('own voxel',own)):
    r=at(b,p)[ok]; out.append(f'{n} {np.median(r[e>0]/e[e>0]):.2f}')
  r=np.maximum(at(up,p),at(down,p))[ok]; out.append(f'signed block {np.median(r[e>0]/e[e>0]):.2f}')
  print(name.split('/')[-1].split('_')[0],how,'median bound/error:',', '.join(out),f'points {ok.sum()}',flush=True)
